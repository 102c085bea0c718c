"""What the two encodings of a motion share: the scaling of widths to bytes, rows of poses, and the result.

In: widths in cycles. Out: `WidthScale`, `Rows`, and `Encoded`, the motion as the chip holds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from servogen.engines.firmware import ResourceError
from servogen.engines.player.arithmetic import FRACTION, Whole, excursion
from servogen.engines.player.knees import Knees
from servogen.engines.player.script import MAX_BYTES, Script, ScriptStep
from servogen.motion.trajectory import Floats

LAST_STEP = 5
"""The maximum shift: steps of 32 cycles."""

KNEE_DOUBLINGS = 30
"""Knees take the C at most 120 cycles for each channel, a doubling 4."""

SPARE = 2
"""The steps left free at both ends of a byte's range."""


@dataclass(frozen=True, slots=True)
class WidthScale:
    """The scaling of widths to bytes: a base for every channel, and its steps of 2**shift cycles; beyond the
    value `knees` a channel is steeper by `bends` 256ths.
    """

    bases: Whole
    shifts: Whole
    knees: Whole = field(default_factory=lambda: np.zeros(1, dtype=np.int64))
    bends: Whole = field(default_factory=lambda: np.zeros(1, dtype=np.int64))

    @property
    def bent(self) -> bool:
        return bool(self.bends.any())

    @property
    def doublings(self) -> int:
        """Return how often the C doubles a value, over all channels; knees count as doublings that take as
        long.
        """
        return int(self.shifts.sum()) + (KNEE_DOUBLINGS * len(self.shifts) if self.bent else 0)

    def exact(self, widths: Floats) -> Floats:
        """Return the widths in steps from the bases; the last axis is the channels."""
        return np.asarray((widths - self.bases) / (1 << self.shifts))

    def widths(self, value: Whole) -> Whole:
        """Return the cycles for values of the chip, in 256ths of a step. Raises ResourceError beyond 16
        bits.
        """
        if value.size and not (value.min() >= 0 and value.max() < 1 << 16):
            raise ResourceError("widths-too-far-apart", "the servos' widths are too far apart for the player")
        beyond = np.maximum((value >> FRACTION) - self.knees, 0)
        added = beyond * np.abs(self.bends) >> FRACTION - self.shifts
        return np.asarray(self.bases + excursion(value, self.shifts) + np.sign(self.bends) * added)

    def moved(self, channels: Sequence[int], cycles: Whole) -> WidthScale:
        """Return the scale with the bases of `channels` moved by whole cycles."""
        bases = self.bases.copy()
        bases[list(channels)] += cycles
        return replace(self, bases=bases)

    def with_knees(self, knees: Knees) -> WidthScale:
        """Return the scale of channels that bend at the steps next to their knees."""
        steps = (knees.widths - self.bases) / (1 << self.shifts)
        places = np.clip(np.floor(steps + 0.5), 0, 255).astype(np.int64)
        return replace(self, knees=np.where(knees.bends, places, 0), bends=knees.bends)


def shift_of(pulsed: Floats) -> int:
    """Return the smallest shift for which all `pulsed` rows (frames, channels) fit bytes."""
    span = (pulsed.max(axis=0) - pulsed.min(axis=0)).max(initial=0.0)
    for shift in range(LAST_STEP + 1):
        if span <= (255 - 2 * SPARE) << shift:
            return shift
    raise ResourceError("widths-too-far-apart", "the servos' widths are too far apart for the player")


def scale_of(pulsed: Floats, shifts: Whole | None = None) -> WidthScale:
    """Return the scale of `pulsed` rows (frames, channels), with the smallest steps unless given."""
    low = pulsed.min(axis=0)
    if shifts is None:
        shifts = np.full(pulsed.shape[1], shift_of(pulsed))
    return WidthScale(np.floor(low).astype(np.int64) - (SPARE << shifts), shifts)


@dataclass(slots=True)
class Rows:
    """Rows of bytes; poses that are close to each other share a row in the middle between them."""

    near: float
    """The maximum distance from the middle, in steps, before it is rounded."""
    lows: list[Floats] = field(default_factory=list)
    highs: list[Floats] = field(default_factory=list)

    def number(self, exact: Floats) -> int:
        """Return the number of the row for these values, adding a new row if none is close."""
        if self.lows:
            lows, highs = np.minimum(self.lows, exact), np.maximum(self.highs, exact)
            away = (highs - lows).max(axis=1) / 2
            best = int(np.argmin(away))
            if away[best] <= self.near:
                self.lows[best], self.highs[best] = lows[best], highs[best]
                return best
        self.lows.append(exact)
        self.highs.append(exact)
        return len(self.lows) - 1

    @property
    def kept(self) -> list[tuple[int, ...]]:
        """Return the rows by number."""
        middles = (np.array(self.lows) + np.array(self.highs)) / 2
        return [tuple(row) for row in np.clip(np.floor(middles + 0.5), 0, 255).astype(int).tolist()]


@dataclass(frozen=True, slots=True)
class Legs:
    """The channels of the legs' turning and lifting servos, and the places of the lifts' poses in the
    rows.
    """

    turns: tuple[int, ...]
    lifts: tuple[int, ...]
    stand: int
    lifted: int
    neutral: int | None = None
    """The lifts' pose at power-up if it differs from the stance."""


@dataclass(frozen=True, slots=True, eq=False)
class Encoded:
    """A motion as the chip holds it, and the resulting widths.

    `frames` are those of the planned motion, one per row of `widths`; the first `lead` are played once.
    """

    scale: WidthScale
    rows: bytes
    laws: bytes
    script: Script
    legs: Legs | None
    frames: Whole
    widths: Whole
    silent: np.ndarray
    lead: int
    steps: tuple[ScriptStep, ...]
    """The steps of the script; the first only tells where the second begins."""

    @property
    def stride(self) -> int:
        """Return the bytes from a row of poses to the next in a table of the C."""
        columns = len(self.legs.turns) if self.legs else len(self.scale.bases)
        return stride_of(len(self.rows) // columns, columns)

    @property
    def size(self) -> int:
        """Return the size of the tables in bytes."""
        bends = 2 * len(self.legs.turns) if self.legs and self.scale.bent else 0
        return len(self.rows) + len(self.laws) + len(self.script.data) + 3 * len(self.script.timings) + bends


def stride_of(rows: int, columns: int) -> int:
    """Return the bytes from a row to the next: of halves of rows, in two tables, if one cannot hold all."""
    return columns if rows * columns <= MAX_BYTES else (columns + 1) // 2


def row_table(rows: Sequence[Sequence[int]], *, limited: bool = True, halves: bool = False) -> bytes:
    """Return rows one after the other. Raises ResourceError if the table is `limited`, or are the two of the
    `halves` of rows, and they do not fit.
    """
    data = bytes(value for row in rows for value in row)
    stride = stride_of(len(rows), len(rows[0])) if halves else len(rows[0])
    if limited and len(rows) * stride > MAX_BYTES:
        holds = "two tables hold" if halves else "table holds"
        raise ResourceError(
            "does-not-fit",
            f"the motion's poses have {len(data)} bytes: their {holds} {MAX_BYTES << halves}",
            hint="a motion of fewer different frames (fewer segments, a shorter cycle_s, a greater "
            "max_error_us) needs fewer; two chips ([[chip]] twice) hold about half of them each",
        )
    return data
