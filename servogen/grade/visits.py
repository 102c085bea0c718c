"""What the servos do together, position by position: pulses -> `Visit`s.

In: the pulses of each servo's pin. Out: what the servos are told, from one change to the next. A servo is
told its last pulse's angle until it gets another one.

    arm    ┤ 30° ··· 30° │ silence │ 90° 90° ··· 90° │
    visit  ├──────── 30° ──────────┼────── 90° ──────┤     begin, end: its first pulse, the next one's
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from servogen.grade.lab import Position
from servogen.grade.watch import PinPulses, Watched
from servogen.robot.servo import Servo

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
