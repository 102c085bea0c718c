"""The check of a watched program against its lab: pulses and facts of the chip go in, a `Grade` comes out.

Where a lab allows several pins or has several solutions, the program is compared with each. It passes if it
matches one; otherwise the grade says what is wrong compared with the nearest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from servogen.edges import PINS
from servogen.errors import Diagnostic
from servogen.grade.checks import (
    ChipFacts,
    Stay,
    cause,
    clock_words,
    end_reason,
    first_wrong,
    order,
    order_reasons,
    pause_reasons,
    period_reasons,
    period_remark,
    sequence,
    silent_reasons,
    stays,
    travel_reasons,
)
from servogen.grade.film import Film
from servogen.grade.lab import Lab, Solution
from servogen.grade.watch import PinPulses, Watched, visits, without_moves


@dataclass(frozen=True, slots=True)
class Row:
    """A position of the task and how the program holds it, over all visits; None: not measured."""

    name: str
    visits: int
    widths_us: tuple[tuple[float, float], ...]
    """The shortest and the longest pulse of each servo."""
    angles_deg: tuple[tuple[float, float], ...]
    periods_ms: tuple[float, float] | None
    stays_s: tuple[float, float] | None
    """From its first pulse to the first pulse of the next position."""
    silent_s: tuple[float, float] | None
    """The longest time without pulses in a visit."""
    pause_s: float | None
    """The pause that the task requires."""

    def to_json(self) -> dict[str, object]:
        return {
            "position": self.name,
            "visits": self.visits,
            "widths_us": self.widths_us,
            "angles_deg": self.angles_deg,
            "periods_ms": self.periods_ms,
            "stays_s": self.stays_s,
            "silent_s": self.silent_s,
            "asked_pause_s": self.pause_s,
        }


@dataclass(frozen=True, slots=True)
class Grade:
    """`passed`: the program does what the lab requires, and `reasons` is empty."""

    lab: str
    passed: bool
    reasons: tuple[str, ...]
    """Why it is wrong, the most helpful reason first: text for students, on which nothing depends."""
    remarks: tuple[Diagnostic, ...] = ()
    """Notes on a program, whether right or wrong."""
    pins: tuple[tuple[str, str], ...] = ()
    """(servo, the pin with its pulses)."""
    rows: tuple[Row, ...] = ()
    seen: str = ""
    """The program's order of positions."""
    watched_s: float = 0.0
    repeats: bool = False
    """Whether the chip's whole state was seen to repeat, so that this goes on endlessly."""
    moment: int | None = None
    """The cycle of the first thing that is not as asked, where there is one such moment."""
    film: Film | None = None
    """What there is to be seen around that moment."""

    def to_json(self) -> dict[str, object]:
        """Return the grade as plain values for JSON."""
        return {
            "lab": self.lab,
            "passed": self.passed,
            "reasons": list(self.reasons),
            "remarks": [each.to_json() for each in self.remarks],
            "pins": dict(self.pins),
            "positions": [row.to_json() for row in self.rows],
            "seen": self.seen,
            "watched_s": self.watched_s,
            "repeats": self.repeats,
        }


def refused(lab: str, *reasons: str) -> Grade:
    """Return the grade of a program that could not be run."""
    return Grade(lab, False, reasons)


MAX_WIRINGS = 64


def judge(lab: Lab, watched: Watched, chip: ChipFacts) -> Grade:
    """Return the grade of a program that was watched."""
    seconds = float(watched.clock.seconds(watched.end))
    why = cause(lab, watched, chip)
    if why is not None:
        return Grade(lab.name, False, (why,), watched_s=seconds)
    silent = tuple(silent_reasons(lab, watched, chip))
    if silent:
        return Grade(lab.name, False, silent, watched_s=seconds)
    grades = [
        _judge_solution(lab, solution, watched, pins, chip)
        for pins in _wirings(lab, watched)
        for solution in lab.solutions
    ]
    return min(grades, key=lambda grade: (not grade.passed, len(grade.reasons)))


def _wirings(lab: Lab, watched: Watched) -> Iterator[tuple[int, ...]]:
    """Yield the pins that the servos may be on: the lab's own if it has pulses, else any allowed one."""
    choices = []
    for each in lab.servos:
        active = [PINS.index(pin) for pin in each.pins if PINS.index(pin) in watched.pins]
        choices.append(active[:1] if PINS[active[0]] == each.pins[0] else active)
    count = 0
    for pins in product(*choices):
        if len(set(pins)) == len(pins) and count < MAX_WIRINGS:
            count += 1
            yield pins


def _judge_solution(
    lab: Lab, solution: Solution, watched: Watched, numbers: tuple[int, ...], chip: ChipFacts
) -> Grade:
    pins = [watched.pins[number] for number in numbers]
    names = [PINS[number] for number in numbers]
    everything = visits(watched, pins, [each.servo for each in lab.servos], solution.positions)
    longest_move = int(lab.longest_move_s * watched.clock.cycles_per_second)
    found = without_moves(everything, longest_move)
    placed = order(found, solution)
    right = stays(watched, pins, found, placed.asked, placed.right)
    ending = end_reason(lab, watched, pins, found, solution)
    reasons = (
        *order_reasons(found, placed, lab, solution),
        *pause_reasons(lab, solution, right),
        *travel_reasons(lab, watched, pins, everything, right, solution),
        *period_reasons(lab, watched, names, pins, solution, right),
        *([ending] if ending else []),
    )
    clock = clock_words(lab, chip)
    if reasons and clock:  # all else that is wrong is a consequence
        reasons = (clock,)
    return Grade(
        lab=lab.name,
        passed=not reasons,
        reasons=reasons,
        remarks=tuple(_remarks(lab, solution, watched, numbers, pins, chip)),
        pins=tuple((each.servo.name, name) for each, name in zip(lab.servos, names, strict=True)),
        rows=tuple(_rows(solution, watched, pins, right, len(lab.servos))),
        seen=sequence(found, solution),
        watched_s=float(watched.clock.seconds(watched.end)),
        repeats=not reasons and chip.repeats,
        moment=first_wrong(found, placed, right, lab, solution) if reasons else None,
    )


def _remarks(
    lab: Lab,
    solution: Solution,
    watched: Watched,
    numbers: Sequence[int],
    pins: Sequence[PinPulses],
    chip: ChipFacts,
) -> Iterator[Diagnostic]:
    for each, number in zip(lab.servos, numbers, strict=True):
        if PINS[number] != each.pins[0]:
            yield Diagnostic(
                "note",
                "other-pin",
                f"the servo '{each.servo.name}' is on {PINS[number]}, not on the lab's {each.pins[0]}: "
                "wire it there",
            )
    others = [PINS[pin] for pin in sorted(watched.pins) if pin not in numbers]
    if others:
        yield Diagnostic(
            "note", "other-pin", f"there are also pulses on {', '.join(others)}, where no servo is connected"
        )
    if len(lab.solutions) > 1 and solution.name:
        yield Diagnostic("note", "graded-as", f"graded as: {solution.name}")
    period = period_remark(watched, pins)
    if period:
        yield Diagnostic("note", "period-range", period)
    if not chip.configured:
        yield Diagnostic(
            "note",
            "no-configuration",
            "the program has no configuration word: an erased chip has its watchdog on",
        )


def _rows(
    solution: Solution, watched: Watched, pins: Sequence[PinPulses], found: Sequence[Stay], servos: int
) -> Iterator[Row]:
    """Yield what was measured at each position of the task."""
    ms = float(watched.clock.cycle_us) / 1000
    for number, position in enumerate(solution.positions):
        own = [stay for stay in found if stay.position == number]
        commanded = [each for stay in own for each in stay.visit.commanded]
        periods = [
            value * ms
            for stay in own
            for pin in pins
            for value in pin.periods(stay.visit.begin, stay.visit.end).tolist()
        ]
        whole = [stay for stay in own if stay.whole]
        yield Row(
            name=position.name,
            visits=len(own),
            widths_us=tuple(
                _ends([each.widths_us[servo] for each in commanded]) for servo in range(servos) if commanded
            ),
            angles_deg=tuple(
                _ends([math.degrees(each.angles[servo]) for each in commanded])
                for servo in range(servos)
                if commanded
            ),
            periods_ms=_ends(periods) if periods else None,
            stays_s=_ends([stay.stays_s for stay in whole]) if whole else None,
            silent_s=_ends([stay.silent_s for stay in whole]) if whole else None,
            pause_s=position.pause_s,
        )


def _ends(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)
