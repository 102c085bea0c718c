"""Widths -> keyframes: bytes on a scale, as few as the table holds, as near to the plan as those allow.

In: the ideal widths of each part, in cycles. Out: `FittedPart`: each part's keyframes and the widths that the
chip makes of them; `pooled`: the table that all parts share. The chip's arithmetic, in whole numbers, bit for
bit:

    between:  eight times: (value + the keyframe that the next bit of the time selects) / 2
              = (p (256 - t) + q t) / 256, with eight bits of fraction, if t has no more bits than n
    width:    base ± (between · step), whole cycles, rounded down
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from servogen.engines.player.parts import ALIKE, Stretch, stretches
from servogen.engines.player.tracks import MAX_BYTES, Pool, signs
from servogen.errors import InputError
from servogen.motion.trajectory import Floats
from servogen.units import Clock

BEST_US, WORST_US = 1, 35
"""The distance from the planned width: as small as the table of keyframes allows, and the limit."""

LOOP_WEIGHT = 4
"""The weight of an error in the loop, relative to one in what is played once."""

NO_WRAP = 255
"""`Part.wrap` of a part whose tracks are not cyclic."""

SURELY_TOO_MANY = 2 * MAX_BYTES
"""Bytes beyond which the keyframes do not fit, however many of them parts share."""

MAX_BITS = 8
LAST_STEP = 7


Whole = npt.NDArray[np.int64]

FRACTION = 8


def between(one: npt.ArrayLike, other: npt.ArrayLike, time: int) -> Whole:
    """Return 256 times the value at `time`/256 of the way from `one` to `other` (bytes)."""
    first, second = np.asarray(one, dtype=np.int64), np.asarray(other, dtype=np.int64)
    value = first << FRACTION
    for bit in range(FRACTION):
        chosen = second if time >> bit & 1 else first
        value = value + (chosen << FRACTION) >> 1
    return value


def excursion(value: npt.ArrayLike, shift: int) -> Whole:
    """Return the cycles from the channel's base, for keyframes in steps of 2**shift cycles."""
    return np.asarray(value, dtype=np.int64) << shift >> FRACTION


@dataclass(frozen=True, slots=True)
class Part:
    """`repeats` times `frames` frames, up to 256; `speed` in 256ths of a keyframe per frame, 0 for a whole
    one.

    `tracks` has for each channel where its keyframes begin and by how many it is ahead. The first keyframe
    follows keyframe `wrap` - 1.
    """

    frames: int
    repeats: int
    speed: int
    wrap: int
    silent: bool
    tracks: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Scale:
    """The conversion of widths to bytes."""

    first: Floats
    lowest: int
    shift: int
    signs: Whole

    def keys(self, rows: Floats) -> Whole:
        """Return the bytes of widths (frames, channels)."""
        above = (rows - self.first) * self.signs - self.lowest
        return np.clip(np.floor(above / (1 << self.shift) + 0.5 + ALIKE / 2), 0, 255).astype(np.int64)

    def bases(self) -> Whole:
        """Return the width in cycles of each channel's byte 0."""
        return np.round(self.first).astype(np.int64) + self.signs * self.lowest

    def widths(self, value: Whole) -> Whole:
        """Return the widths in cycles of values between keyframes."""
        return self.bases() + self.signs * excursion(value, self.shift)


@dataclass(frozen=True, slots=True)
class FittedPart:
    """A part's keyframes and the widths that they give."""

    stretch: Stretch
    speed: int
    ring: bool
    keys: Whole
    widths: Whole


Section = tuple[Stretch, Floats]
"""A stretch and its rows, the frame after them included."""


def sections(rows: Floats, following: Floats) -> list[Section]:
    """Return the parts of `rows` (frames, channels); `following` is the row of the frame after them."""
    if not len(rows):
        return []
    parts = []
    for each in stretches(rows, following):
        mine = rows[each.first : each.first + each.frames]
        end = each.first + each.frames
        after = rows[end] if end < len(rows) else following
        after = mine[-1] if np.isnan(after).any() else after
        parts.append((each, np.vstack((mine, after))))
    return parts


def scale_of(pulsed: Floats, parts: Sequence[Section]) -> Scale:
    """Return the smallest steps with which all `pulsed` rows are bytes, and a sign for each channel."""
    first = np.round(pulsed[0])
    every = pulsed - first
    cycles = [
        (section[1][:-1] - first)
        for section in parts
        if section[0].repeats > 1 and not section[0].silent and section[0].frames > 1
    ]
    ends = np.cumsum([0, *(len(rows) for rows in cycles)]).tolist()
    rings = [(a, b - a) for a, b in pairwise(ends)]
    sign = np.array(signs(np.concatenate(cycles) if cycles else every, rings), dtype=np.int64)
    lowest = int(np.floor((every * sign).min()))
    span = (every * sign).max() - lowest
    for shift in range(LAST_STEP + 1):
        if span <= 255 << shift:
            return Scale(first, lowest, shift, sign)
    raise InputError("does-not-fit", "the servos' widths are too far apart for the player")


def fitting(parts: Sequence[Section], scale: Scale, clock: Clock, loop: int) -> list[FittedPart]:
    """Return the parts as near to the plan as their keyframes fit the table; those from `loop` on repeat.

    Each part begins with as many keyframes as it needs. While there are too many, the part gets fewer whose
    error grows least for the bytes that it saves. Raises InputError if they do not fit.
    """
    best, worst = (float(us / clock.cycle_us) for us in (BEST_US, WORST_US))
    choices = [_choices(section, scale, best, worst) for section in parts]
    taken = [0] * len(choices)
    _check_size([choice[-1][0] for choice in choices], SURELY_TOO_MANY)
    while True:
        fitted = [choice[number][0] for choice, number in zip(choices, taken, strict=True)]
        size = len(pooled(fitted)[0].data)
        if size <= MAX_BYTES:
            return fitted
        options = []
        for part, each in enumerate(choices):
            for number in range(taken[part] + 1, len(each)):
                other = [*fitted[:part], each[number][0], *fitted[part + 1 :]]
                saved = size - len(pooled(other)[0].data)
                grown = (each[number][1] - best / 2) * (LOOP_WEIGHT if part >= loop else 1)
                if saved > 0:
                    options.append((grown / saved, part, number))
        if not options:
            _check_size(fitted, MAX_BYTES)
        _, part, taken[part] = min(options)


def _check_size(parts: list[FittedPart], limit: int) -> None:
    """Raise InputError for parts whose keyframes are more than `limit` bytes."""
    size = len(pooled(parts)[0].data)
    if size > limit:
        raise InputError(
            "does-not-fit",
            f"within {WORST_US} µs of the plan the motion has {size} bytes of keyframes: "
            f"the player's table holds {MAX_BYTES}",
            hint="shorten the motion, or let more of it repeat",
        )


def _choices(section: Section, scale: Scale, best: float, worst: float) -> list[tuple[FittedPart, float]]:
    """Return a part with fewer and fewer keyframes, and its error in cycles, up to `worst`."""
    stretch, rows = section
    if stretch.silent:
        keys = np.zeros((1, rows.shape[1]), dtype=np.int64)
        return [
            (FittedPart(stretch, 1, True, keys, np.repeat(scale.widths(keys), stretch.frames, axis=0)), 0.0)
        ]
    # A pose that is held has one keyframe, and no frame of it may be on the way to a second.
    spacings = (MAX_BITS,) if _held(rows) else range(MAX_BITS + 1)
    every = [_sampled(stretch, rows, scale, bits) for bits in spacings]
    errors = [float(np.abs(fitted.widths - rows[:-1]).max()) for fitted in every]
    first = max((number for number, error in enumerate(errors) if error <= best), default=0)
    return [
        (every[number], errors[number])
        for number in range(first, len(every))
        if number == first
        or (errors[number] <= worst and len(every[number].keys) < len(every[number - 1].keys))
    ]


def _held(rows: Floats) -> bool:
    return bool((np.abs(rows - rows[0]) < ALIKE).all())


def _sampled(stretch: Stretch, rows: Floats, scale: Scale, bits: int) -> FittedPart:
    """Return the keyframes, every 2**bits frames, whose interpolation is nearest to the rows in least
    squares.
    """
    frames, apart = stretch.frames, 1 << bits
    segments = -(-frames // apart)
    same = _held(rows)
    round_again = frames % apart == 0 and segments < NO_WRAP
    ring = same or (round_again and bool((np.abs(rows[-1] - rows[0]) < ALIKE).all()))
    count = 1 if same else segments + (not ring)
    times = np.arange(frames + (not ring))  # a round's last row is its first one
    one, other = times // apart % count, (times // apart + 1) % count
    share = times % apart / apart
    shares = np.zeros((len(times), count))
    np.add.at(shares, (times, one), 1 - share)
    np.add.at(shares, (times, other), share)
    nearest = np.linalg.lstsq(shares, rows[: len(times)] - scale.first, rcond=None)[0] + scale.first
    keys = scale.keys(nearest)
    widths = np.stack(
        [
            scale.widths(between(keys[a], keys[b], int(time % apart) << MAX_BITS - bits))
            for time, a, b in zip(times[:frames], one, other, strict=False)
        ]
    )
    return FittedPart(stretch, 256 >> bits & 0xFF, ring, keys, widths)


def pooled(fitted: list[FittedPart]) -> tuple[Pool, tuple[Part, ...]]:
    """Return the tracks of all parts, placing cyclic ones first, since others may be found in them."""
    pool = Pool()
    columns = [[bytes(column) for column in each.keys.T.tolist()] for each in fitted]
    pairs = list(zip(fitted, columns, strict=True))
    rings = sorted((keys for each, mine in pairs if each.ring for keys in mine), key=len, reverse=True)
    for keys in rings:
        pool.place(keys, ring=True)
    pool.place_all({keys for each, mine in pairs if not each.ring for keys in mine})
    tracks = [tuple(pool.place(keys, ring=each.ring) for keys in mine) for each, mine in pairs]
    parts = tuple(
        Part(
            each.stretch.frames,
            each.stretch.repeats,
            each.speed,
            len(each.keys) if each.ring else NO_WRAP,
            each.stretch.silent,
            tracks[number],
        )
        for number, each in enumerate(fitted)
    )
    return pool, parts
