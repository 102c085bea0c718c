"""Two chips with a crystal each -> runs of both at several frequencies, and by how much the second one's
pulses are off their places.

In: schedules and programs. Out: the edges of both chips, the second one's as they would be if its looks saw
each rise at once and its crystal were the first one's, so that they compare with its schedule; and `Jitter`.

    first    its cycles ──▶ the wire's edges ──× rate, + phase──▶ the second one's cycles ──▶ its edges
    second   the frame of each edge is that of the latest rise, from the look on that saw it
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import product
from math import ceil, floor
from typing import TYPE_CHECKING

import numpy as np

from servogen.edges import HIGH, LOW, PINS, EdgeChunk, EdgeTrace, join, part
from servogen.engines.board import board_of, machine_of
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import POLL_CYCLES, WireRule, drift
from servogen.simulator import LevelChange, Levels, Machine, Stimuli
from servogen.simulator.layout import MCLR_PIN
from servogen.units import Cycles

if TYPE_CHECKING:
    from servogen.answers import JitterAnswer

Pair = tuple[PulseSchedule, PulseSchedule]

PHASES = Fraction(0), Fraction(3, 2)
"""The times in cycles by which the first chip's power-up is after the second one's, in which it is at 0."""


@dataclass(frozen=True, slots=True)
class Jitter:
    """Where the pulses of a second chip with a crystal of its own are, in µs after their places in the first
    one's time: the least and the most in `runs`, and what the looks and both crystals allow.
    """

    crystal_ppm: int
    runs: int
    seen_us: tuple[float, float]
    allowed_us: tuple[Fraction, Fraction]

    def text(self) -> str:
        """Return the jitter, and what it was measured over, in a line."""
        # The edges were measured in floating point, far finer than this.
        seen = (Fraction(each).limit_denominator(10**6) for each in self.seen_us)
        return (
            f"chip2's pulses come {outwards(*seen)} from their places; two crystals of "
            f"±{self.crystal_ppm} ppm and the looks allow {outwards(*self.allowed_us)}"
        )

    def to_json(self) -> JitterAnswer:
        return {
            "crystal_ppm": self.crystal_ppm,
            "runs": self.runs,
            "seen_us": list(self.seen_us),
            "allowed_us": [float(each) for each in self.allowed_us],
        }


def outwards(least_us: Fraction, most_us: Fraction) -> str:
    """Return bounds as text, rounded to those that contain them."""
    return f"{floor(10 * least_us) / 10:+.1f} to {ceil(10 * most_us) / 10:+.1f} µs"


@dataclass(frozen=True, slots=True)
class OwnRun:
    """One run: the edges of both chips, to be compared with their schedules, and the least and the most
    cycles by which those of the second one are late.
    """

    traces: tuple[EdgeTrace, EdgeTrace]
    late: tuple[float, float]


def jitter(rule: WireRule, period: Cycles) -> tuple[Fraction, Fraction]:
    """Return by how many cycles the second chip's edges may be late, at least and at most: a look, which sees
    a rise less than `POLL_CYCLES` late, and what the crystals drift in a frame.
    """
    drifted = drift(rule.crystal_ppm) * period
    return -drifted, POLL_CYCLES + drifted


def limit_runs(
    schedules: Pair, images: tuple[Image, Image], rule: WireRule, limit: Cycles
) -> Iterator[OwnRun]:
    """Yield runs at both limits of the crystals and at equal frequencies, at each of `PHASES`."""
    fastest = 1 + drift(rule.crystal_ppm)

    @cache
    def leads(mclr: tuple[tuple[int, int], ...]) -> EdgeChunk:
        machine = machine_of(schedules[0], images[0])
        machine.apply([LevelChange(cycle, MCLR_PIN, level) for cycle, level in mclr])
        return join(machine.stream(limit))

    for rate, phase in product((1 / fastest, Fraction(1), fastest), PHASES):
        pulls = [(int(cycle / rate), level) for cycle, level in _pulls(schedules, images, rule)]
        yield _run(schedules, images[1], rule, leads(tuple(pulls)), rate, phase, limit)


def _pulls(schedules: Pair, images: tuple[Image, Image], rule: WireRule) -> list[tuple[int, int]]:
    """Return when the second chip pulls the first one's MCLR, before it reads anything, and lets go."""
    if rule.restart is None:
        return []
    edges = machine_of(schedules[1], images[1]).run(schedules[1].period)
    mine = edges.pin == PINS.index(rule.restart)
    levels = (edges.level[mine] != LOW).astype(int)
    return list(zip(edges.cycle[mine].tolist(), levels.tolist(), strict=True))


def _run(
    schedules: Pair,
    image: Image,
    rule: WireRule,
    leads: EdgeChunk,
    rate: Fraction,
    phase: Fraction,
    limit: Cycles,
) -> OwnRun:
    first, second = schedules
    mine = leads.pin == PINS.index(rule.source)
    wire = [
        (ceil(cycle * rate + phase), int(level == HIGH))
        for cycle, level in zip(leads.cycle[mine].tolist(), leads.level[mine].tolist(), strict=True)
    ]
    levels = Levels(PINS.index(rule.pin), ((0, 0), *wire))
    machine = Machine(image, second.clock, board_of(second), Stimuli([levels]))
    edges = join(machine.stream(limit))
    source_rises = leads.cycle[mine & (leads.level == HIGH)]
    rises = np.array([cycle for cycle, level in wire if level], dtype=np.int64)
    if not len(rises):  # nothing follows
        rises = source_rises = np.array([int(limit)])
    pulses = np.isin(edges.pin, [PINS.index(channel.pin) for channel in second.channels])
    frame = np.searchsorted(rises, edges.cycle, side="right") - 1
    followed = part(edges, pulses & (frame >= 0))
    frames = frame[pulses & (frame >= 0)]
    numbers, places = np.unique(frames, return_index=True)
    seen = np.zeros(len(rises), dtype=np.int64)
    seen[numbers] = followed.cycle[places] - rises[numbers] - rule.cycles
    # What is off by more than the looks allow stays off.
    late = np.clip(seen, 0, POLL_CYCLES - 1)
    begins = source_rises[0] + np.arange(len(rises)) * int(second.period) - rises - late
    nominal = edges._replace(cycle=np.where(frame < 0, edges.cycle, edges.cycle + begins[frame]))
    nominal = part(nominal, np.argsort(nominal.cycle, kind="stable"))
    there = (followed.cycle - float(phase)) / float(rate)
    off = there - source_rises[frames] - (followed.cycle - (rises + seen)[frames])
    traces = EdgeTrace(first.clock, [leads], limit), EdgeTrace(second.clock, [nominal], limit)
    return OwnRun(traces, (float(off.min()), float(off.max())) if len(off) else (0.0, 0.0))
