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

from servogen.edges import EdgeTrace
from servogen.grade.lab import TaskPosition
from servogen.pulses import PulseReader, joined
from servogen.robot.servo import Servo
from servogen.units import Clock

Ints = npt.NDArray[np.int64]

MAX_EDGES = 1_000_000
"""The maximum number of edges: far more than 13 servos make in the time of any lab."""

GLITCH_US = 250
"""The longest first pulse of a pin that is none: between becoming an output and first being written, the pin
shows what its latch holds at power-up. No servo takes so short a pulse."""

PAUSE_PERIODS = 3
"""The number of median periods beyond which the time from rise to rise contains a pause: one or two
missing pulses are none."""


class PinPulses(NamedTuple):
    """The whole pulses of one pin, in cycles."""

    rise: Ints
    fall: Ints

    @property
    def period(self) -> int:
        """Return the median time from rise to rise; 0 if there is none."""
        return int(np.median(np.diff(self.rise))) if len(self.rise) > 1 else 0

    @property
    def longest_period(self) -> int:
        """Return the longest time from rise to rise that has no pause in it."""
        return PAUSE_PERIODS * self.period

    def periods(self, begin: int, end: int) -> Ints:
        """Return the times between neighbouring rises in [begin, end), without pauses."""
        gaps = np.diff(self.rises(begin, end))
        return gaps[gaps <= self.longest_period]

    def turns(self) -> Turns:
        """Return the pulses from one pause to the next."""
        after = np.flatnonzero(np.diff(self.rise) > self.longest_period)
        return Turns(self.rise[np.append(0, after + 1)], self.rise[np.append(after, len(self.rise) - 1)])

    def rises(self, begin: int, end: int) -> Ints:
        """Return the rises in [begin, end)."""
        first, stop = np.searchsorted(self.rise, (begin, end))
        return self.rise[first:stop]

    def silence(self, begin: int, end: int) -> int:
        """Return the longest pause that begins in [begin, end), cut off at `end`; 0 if there is none."""
        fall = self.fall
        following = np.append(self.rise[1:], np.iinfo(np.int64).max)
        pause = (fall >= begin) & (fall < end) & (following - self.rise > self.longest_period)
        return int((np.minimum(following[pause], end) - fall[pause]).max(initial=0))


class Turns(NamedTuple):
    """The first and the last rise of each sequence of pulses of one pin without a pause, in cycles."""

    first: Ints
    last: Ints

    def pauses(self, begin: int, end: int) -> list[tuple[int, int]]:
        """Return the rises in [begin, end) before and after each pause between them."""
        before, after = self.last[:-1], self.first[1:]
        inside = (before >= begin) & (after < end)
        return list(zip(before[inside].tolist(), after[inside].tolist(), strict=True))

    def has_between(self, begin: int, end: int) -> bool:
        """Return whether the first sequence that begins after `begin` ends before `end`."""
        following = self.last[self.first > begin]
        return bool(len(following)) and int(following[0]) < end


@dataclass(frozen=True, slots=True)
class Watched:
    """The pulses up to cycle `end`; pins without a whole pulse are not in `pins`."""

    clock: Clock
    end: int
    pins: Mapping[int, PinPulses]
    high_since: Mapping[int, int]
    """The pins that are high at the end, each with the cycle of its rise."""
    too_fast: bool
    """Whether the watch ended early, because there were more edges than servos can use."""


def watch(trace: EdgeTrace) -> Watched:
    """Return all pulses of `trace`."""
    reader, ended = PulseReader(), []
    edges, end = 0, int(trace.end)
    for chunk in trace.driven():
        ended.append(reader(chunk))
        edges += len(chunk.cycle)
        if edges > MAX_EDGES:
            end = int(chunk.cycle[-1])
            break
    too_fast = edges > MAX_EDGES
    cut = reader.cut(end)
    high_since = dict(zip(cut.pin.tolist(), cut.rise.tolist(), strict=True))
    seen, pins = joined([*ended, cut]).whole(), {}
    for pin in np.unique(seen.pin).tolist():
        own = seen.of(pin)
        glitch = int(trace.clock.us(int(own.width[0])) <= GLITCH_US)
        if len(own.rise) > glitch:
            pins[pin] = PinPulses(own.rise[glitch:], own.fall[glitch:])
    return Watched(clock=trace.clock, end=end, pins=pins, high_since=high_since, too_fast=too_fast)


JUMP_RAD = 0.07
"""The difference of angles (4°) from which on they are different positions."""


@dataclass(frozen=True, slots=True)
class Commanded:
    """From `cycle` on the servos are commanded to `angles` (radians) by pulses of `widths_us`."""

    cycle: int
    angles: tuple[float, ...]
    widths_us: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Visit:
    """A stay at one of the task's positions, or at none if `places` is empty; from cycle to cycle."""

    begin: int
    end: int
    places: frozenset[int]
    """The numbers of the positions that the visit may belong to."""
    commanded: tuple[Commanded, ...]

    @property
    def cycles(self) -> int:
        return self.end - self.begin


def visits(
    watched: Watched, pins: Sequence[PinPulses], servos: Sequence[Servo], positions: Sequence[TaskPosition]
) -> list[Visit]:
    """Return the visits from when every servo has had a pulse to the end of the watch."""
    stops: list[Visit] = []
    commands = list(_commands(watched, pins, servos))
    ends = [*(command.cycle for command in commands[1:]), watched.end]
    for command, end in zip(commands, ends, strict=True):
        if end == command.cycle:  # two servos change in one cycle: the second change is both
            continue
        places = frozenset(
            number for number, position in enumerate(positions) if position.holds(command.angles)
        )
        if stops and stops[-1].places == places:
            last = stops.pop()
            stops.append(Visit(last.begin, end, places, (*last.commanded, command)))
        else:
            stops.append(Visit(command.cycle, end, places, (command,)))
    return stops


def _commands(watched: Watched, pins: Sequence[PinPulses], servos: Sequence[Servo]) -> Iterator[Commanded]:
    """Yield each change of the commanded angles."""
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
            yield Commanded(cycle, angles, widths)


def without_moves(stops: Sequence[Visit], longest: int, passing: int | None = None) -> list[Visit]:
    """Return the visits without ramps: up to `longest` cycles of angles between those of two positions.

    A position that a ramp passes in at most `passing` cycles (None: a quarter of `longest`) is part of it.
    Any other visit to no position is split where its angles jump: each part is a place of its own.
    """
    kept = []
    stops = _through(stops, longest // 4 if passing is None else passing)
    for index, visit in enumerate(stops):
        if 0 < index < len(stops) - 1 and not visit.places and visit.cycles <= longest:
            before, after = stops[index - 1].commanded[-1].angles, stops[index + 1].commanded[0].angles
            if all(_between(command.angles, before, after) for command in visit.commanded):
                continue
        kept += [visit] if visit.places else _parts(visit)
    return kept


def _through(stops: Sequence[Visit], longest: int) -> list[Visit]:
    """Return the visits, a position that a ramp only passes through being part of that ramp."""
    joined: list[Visit] = []
    for index, visit in enumerate(stops):
        inside = joined and not joined[-1].places and index + 1 < len(stops) and not stops[index + 1].places
        goes_on = joined and not joined[-1].places and not visit.places
        if (inside and visit.cycles <= longest) or goes_on:
            last = joined.pop()
            visit = Visit(last.begin, visit.end, last.places, (*last.commanded, *visit.commanded))
        joined.append(visit)
    return joined


def _parts(visit: Visit) -> list[Visit]:
    starts = [0]
    for index, (before, after) in enumerate(pairwise(visit.commanded), 1):
        if any(abs(old - new) > JUMP_RAD for old, new in zip(before.angles, after.angles, strict=True)):
            starts.append(index)
    cycles = [*(visit.commanded[start].cycle for start in starts[1:]), visit.end]
    return [
        Visit(visit.commanded[start].cycle, end, visit.places, visit.commanded[start:stop])
        for start, stop, end in zip(starts, [*starts[1:], len(visit.commanded)], cycles, strict=True)
    ]


def _between(angles: Sequence[float], start: Sequence[float], stop: Sequence[float]) -> bool:
    ends = zip(start, stop, strict=True)
    return all(min(pair) <= angle <= max(pair) for angle, pair in zip(angles, ends, strict=True))
