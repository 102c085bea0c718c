"""What the servos do while a program is watched: a trace -> pulses of each pin -> `Visit`s.

In: a trace. Out: arrays of rises and falls, and the stays at positions, from one change to the next:
a servo keeps the angle of its last pulse until it gets another one. A program that toggles a pin far faster
than a servo could follow is watched only until that is clear.

    arm    ┤ 30° ··· 30° │ silence │ 90° 90° ··· 90° │
    visit  ├──────── 30° ──────────┼────── 90° ──────┤     begin, end: its first pulse, the next one's
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, EdgeTrace, join
from servogen.grade.lab import Position
from servogen.robot.servo import Servo
from servogen.units import Clock

Ints = npt.NDArray[np.int64]

MOST_EDGES = 1_000_000
"""13 servos for an hour make fewer by far in any lab's time."""

PAUSE_PERIODS = 3
"""A time from rise to rise of more than so many (median) periods has a pause in it."""


class PinPulses(NamedTuple):
    """The whole pulses of one pin, in cycles."""

    rise: Ints
    fall: Ints

    @property
    def period(self) -> int:
        """The median of the times from rise to rise; 0 where there is none."""
        return int(np.median(np.diff(self.rise))) if len(self.rise) > 1 else 0

    @property
    def longest_period(self) -> int:
        """A longer time from rise to rise has a pause in it."""
        return PAUSE_PERIODS * self.period

    def periods(self, begin: int, end: int) -> Ints:
        """Times from rise to rise of neighbours that both rise in [begin, end), pauses left out."""
        inside = self.rise[(self.rise >= begin) & (self.rise < end)]
        gaps = np.diff(inside)
        return gaps[gaps <= self.longest_period]

    def silence(self, begin: int, end: int) -> int:
        """The longest pause that begins in [begin, end), as far as it lies therein; 0: none."""
        fall = self.fall
        following = np.append(self.rise[1:], np.iinfo(np.int64).max)
        pause = (fall >= begin) & (fall < end) & (following - self.rise > self.longest_period)
        return int((np.minimum(following[pause], end) - fall[pause]).max(initial=0))


@dataclass(frozen=True, slots=True)
class Watched:
    """What was seen up to cycle `end`; pins without a whole pulse are not in `pins`."""

    clock: Clock
    end: int
    pins: Mapping[int, PinPulses]
    high_since: Mapping[int, int]
    """Pins that are high at the end, and since which cycle."""
    too_fast: bool
    """The watch ended early: there were more edges than servos can use."""


def watch(trace: EdgeTrace) -> Watched:
    """All pulses of `trace`."""
    chunks, edges = [], 0
    for chunk in trace.driven():
        chunks.append(chunk)
        edges += len(chunk.cycle)
        if edges > MOST_EDGES:
            break
    too_fast = edges > MOST_EDGES
    seen = join(chunks)
    end = int(seen.cycle[-1]) if too_fast else int(trace.end)
    pins, high_since = {}, {}
    for pin in np.unique(seen.pin).tolist():
        own = seen.pin == pin
        rise = seen.cycle[own & (seen.level == HIGH)]
        fall = seen.cycle[own & (seen.level != HIGH)]
        if len(fall) < len(rise):
            high_since[pin] = int(rise[-1])
        if len(fall):
            pins[pin] = PinPulses(rise[: len(fall)], fall)
    return Watched(trace.clock, end, pins, high_since, too_fast)


JUMP_RAD = 0.07
"""Angles that differ by more than this (4°) are told apart."""


@dataclass(frozen=True, slots=True)
class Told:
    """From `cycle` on the servos are told `angles` (radians) by pulses of `widths_us`."""

    cycle: int
    angles: tuple[float, ...]
    widths_us: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Visit:
    """A stay at one of the task's positions, or where `places` is empty at none; from cycle to cycle."""

    begin: int
    end: int
    places: frozenset[int]
    """The numbers of the positions that it can be."""
    told: tuple[Told, ...]

    @property
    def cycles(self) -> int:
        return self.end - self.begin


def visits(
    watched: Watched, pins: Sequence[PinPulses], servos: Sequence[Servo], positions: Sequence[Position]
) -> list[Visit]:
    """From the cycle on at which every servo has had a pulse, to the end of the watch."""
    found: list[Visit] = []
    told = list(_told(watched, pins, servos))
    ends = [*(each.cycle for each in told[1:]), watched.end]
    for each, end in zip(told, ends, strict=True):
        if end == each.cycle:  # two servos change in one cycle: the second change is both
            continue
        places = frozenset(number for number, position in enumerate(positions) if position.holds(each.angles))
        if found and found[-1].places == places:
            last = found.pop()
            found.append(Visit(last.begin, end, places, (*last.told, each)))
        else:
            found.append(Visit(each.cycle, end, places, (each,)))
    return found


def _told(watched: Watched, pins: Sequence[PinPulses], servos: Sequence[Servo]) -> Iterator[Told]:
    """Each change of what the servos are told."""
    pulses = sorted(
        (rise, number, fall - rise)
        for number, pin in enumerate(pins)
        for rise, fall in zip(pin.rise.tolist(), pin.fall.tolist(), strict=True)
    )
    now: dict[int, int] = {}
    for cycle, number, width in pulses:
        changed = now.get(number) != width
        now[number] = width
        if changed and len(now) == len(servos):
            widths = tuple(float(watched.clock.us(now[index])) for index in range(len(servos)))
            angles = tuple(servo.angle(width) for servo, width in zip(servos, widths, strict=True))
            yield Told(cycle, angles, widths)


def without_moves(found: Sequence[Visit], longest: int) -> list[Visit]:
    """`found` without the ramps: ways of up to `longest` cycles through angles between two positions'.

    What else is at no position is taken apart where its angles jump: each part is a place of its own.
    """
    kept = []
    found = _through(found, longest // 4)
    for index, visit in enumerate(found):
        if 0 < index < len(found) - 1 and not visit.places and visit.cycles <= longest:
            before, after = found[index - 1].told[-1].angles, found[index + 1].told[0].angles
            if all(_between(told.angles, before, after) for told in visit.told):
                continue
        kept += [visit] if visit.places else _parts(visit)
    return kept


def _through(found: Sequence[Visit], longest: int) -> list[Visit]:
    """`found` with each position that a ramp only goes through as a part of that ramp."""
    joined: list[Visit] = []
    for index, visit in enumerate(found):
        inside = joined and not joined[-1].places and index + 1 < len(found) and not found[index + 1].places
        goes_on = joined and not joined[-1].places and not visit.places
        if (inside and visit.cycles <= longest) or goes_on:
            last = joined.pop()
            visit = Visit(last.begin, visit.end, last.places, (*last.told, *visit.told))
        joined.append(visit)
    return joined


def _parts(visit: Visit) -> list[Visit]:
    starts = [0]
    for index, (before, after) in enumerate(pairwise(visit.told), 1):
        if any(abs(one - other) > JUMP_RAD for one, other in zip(before.angles, after.angles, strict=True)):
            starts.append(index)
    cycles = [*(visit.told[start].cycle for start in starts[1:]), visit.end]
    return [
        Visit(visit.told[start].cycle, end, visit.places, visit.told[start:stop])
        for start, stop, end in zip(starts, [*starts[1:], len(visit.told)], cycles, strict=True)
    ]


def _between(angles: Sequence[float], one: Sequence[float], other: Sequence[float]) -> bool:
    ends = zip(one, other, strict=True)
    return all(min(pair) <= angle <= max(pair) for angle, pair in zip(angles, ends, strict=True))
