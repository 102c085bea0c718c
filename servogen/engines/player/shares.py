"""What each part of a motion takes of the player's tables and of a frame, also where they cannot hold it.

In: a job. Out: `Share`s of the tables, which add up to them, and the shortest frame that its pulses need.

A byte belongs to the first part that needs it: a row that two segments share, to the first of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from servogen.engines.inputs.commands import commander
from servogen.engines.player.commanded import encoded_directions
from servogen.engines.player.encoding import Encoded
from servogen.engines.player.layout import Demand, Used, demand
from servogen.engines.player.playing import DATA_BYTES, encoded_motion, ideal_widths, leg_channels
from servogen.engines.player.soft_start import with_soft_start
from servogen.engines.protocol import EngineJob
from servogen.motion.trajectory import Floats, Part
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

if TYPE_CHECKING:
    from servogen.answers import ShareAnswer

TIMING_BYTES = 3
"""The bytes of a timing: its frames and its speed."""

SOFT_START = "soft start"


@dataclass(slots=True)
class Share:
    """The bytes that a part takes, each a word of flash; `error_us` is its largest distance from the plan."""

    name: str
    rows: int = 0
    script: int = 0
    timings: int = 0
    laws: int = 0
    error_us: float | None = None

    @property
    def bytes(self) -> int:
        """Return all bytes of the part."""
        return self.rows + self.script + self.timings + self.laws

    def to_json(self) -> ShareAnswer:
        """Return the share as a value that JSON can hold."""
        return {
            "part": self.name,
            "bytes": self.bytes,
            "rows": self.rows,
            "script": self.script,
            "timings": self.timings,
            "laws": self.laws,
            "error_us": self.error_us,
        }


@dataclass(frozen=True, slots=True)
class Shares:
    """The parts of a motion, and what its pulses need of a frame."""

    parts: tuple[Share, ...]
    pulses: tuple[Used, ...]
    doublings: int
    legs: bool

    @property
    def bytes(self) -> int:
        """Return the bytes of all tables of the motion."""
        return sum(part.bytes for part in self.parts)

    def frame(self, servos: Sequence[Servo], frame: Frame, clock: Clock) -> Demand:
        """Return what the shortest frame needs if `servos` make these pulses."""
        return demand(servos, self.pulses, frame, clock, self.doublings, legs=self.legs)


@dataclass(slots=True)
class _Ledger:
    """Shares by name, in the order in which parts first need something."""

    found: dict[str, Share] = field(default_factory=dict)

    def of(self, name: str) -> Share:
        """Return the share of a part, a new one at its first use."""
        return self.found.setdefault(name, Share(name))


def shares(job: EngineJob) -> Shares:
    """Return the shares of the job's motion. Raises InputError if it cannot be encoded at all."""
    begun, ends = with_soft_start(job.trajectory, job.servos, job.clock, job.firmware.soft_start_s)
    clock, servos = job.clock, job.servos
    soft = len(begun.angles) - len(job.trajectory.angles)
    parts = [Part(SOFT_START, 0)] if soft else []
    ideal: Floats | None = None
    line = commander(job.inputs)
    if line is not None:
        encoded, _ = encoded_directions(
            begun,
            job.directions,
            line,
            servos,
            job.bindings,
            ends,
            DATA_BYTES,
            limited=False,
        )
        begin = len(begun.angles)
        # The tables hold each second direction as the one before it, played backward.
        for forward, backward in zip(job.directions[::2], job.directions[1::2], strict=True):
            parts.append(Part(f"{forward.name} and {backward.name}", begin))
            begin += len(forward.angles) - 1
    else:
        ideal = ideal_widths(begun, servos, clock)
        pairs = leg_channels(servos, job.bindings)
        limit = job.firmware.max_error_us
        encoded = encoded_motion(
            ideal, begun.loop_start, ends, pairs, limit, clock, DATA_BYTES, limited=False
        )
        parts += [Part(part.name, part.begin + soft) for part in job.parts] or [Part("motion", soft)]
    pulsed = encoded.widths[~encoded.silent]
    used = [Used(Cycles(int(channel.min())), Cycles(int(channel.max()))) for channel in pulsed.T]
    frames = len(encoded.widths) if ideal is None else len(ideal)
    loop = frames - begun.loop_start
    ledger = part_shares(encoded, parts, frames, loop)
    if ideal is not None:
        order = np.where(encoded.frames < frames, encoded.frames, encoded.frames - loop)
        away = np.abs(encoded.widths - ideal[order]) * float(clock.cycle_us)
        away[encoded.silent] = 0
        _add_errors(ledger, [_part(parts, frame) for frame in order.tolist()], away.max(axis=1))
    doublings = encoded.scale.doublings
    return Shares(tuple(ledger.found.values()), tuple(used), doublings, encoded.legs is not None)


def _part(parts: Sequence[Part], frame: int) -> str:
    """Return the name of the part to which a frame belongs."""
    return next((part.name for part in reversed(parts) if part.begin <= frame), parts[0].name)


def part_shares(encoded: Encoded, parts: Sequence[Part], frames: int, loop: int) -> _Ledger:
    """Return the shares; of the motion's `frames` the last `loop` repeat."""
    steps = encoded.steps
    # The first step only tells where the second begins.
    begins = [0, 0, *accumulate(step.timing.frames for step in steps[1:])][: len(steps)]
    owner = [_part(parts, begin if begin < frames else begin - loop) for begin in begins]
    ledger = _Ledger()
    for name in owner:
        ledger.of(name)
    columns = len(encoded.legs.turns) if encoded.legs else encoded.widths.shape[1]
    users: dict[int, str] = {}
    timings: dict[object, str] = {}
    for step, name in zip(steps, owner, strict=True):
        users.setdefault(step.row, name)
        timings.setdefault(step.timing, name)
    for row in range(len(encoded.rows) // columns):
        ledger.of(users.get(row, "lifts")).rows += columns
    for byte_owner in encoded.script.owners:
        ledger.of(owner[byte_owner]).script += 1
    for timing in encoded.script.timings:
        ledger.of(timings[timing]).timings += TIMING_BYTES
    if encoded.laws:
        ledger.of("laws").laws += len(encoded.laws)
    return ledger


def _add_errors(ledger: _Ledger, names: Sequence[str], away_us: Floats) -> None:
    """Add the largest distance from the plan of each part, from its name and the distance in each frame."""
    for name, away in zip(names, away_us.tolist(), strict=True):
        share = ledger.of(name)
        share.error_us = max(share.error_us or 0.0, round(away, 3))
