"""The check of a watched program against its lab: pulses and facts of the chip go in, a `Grade` comes out.

Where a lab allows several pins or has several solutions, the program is compared with each. It passes if it
matches one; otherwise the grade says what is wrong compared with the nearest.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, permutations, product
from typing import TYPE_CHECKING

from servogen.edges import PINS
from servogen.errors import Diagnostic
from servogen.grade.checks import (
    Attempt,
    ChipFacts,
    Fault,
    Stay,
    VisitOrder,
    cause,
    clock_words,
    end_faults,
    first_wrong,
    interruption_faults,
    move_faults,
    order,
    order_faults,
    pause_faults,
    period_faults,
    period_remark,
    sequence,
    silent_reasons,
    stays,
    travel_faults,
)
from servogen.grade.film import Film
from servogen.grade.lab import Check, Lab, Solution
from servogen.grade.watch import Visit, Watched, visits, without_moves

if TYPE_CHECKING:
    from servogen.answers import GradeFacts, PositionAnswer


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

    def to_json(self) -> PositionAnswer:
        return {
            "position": self.name,
            "visits": self.visits,
            "widths_us": [*map(list, self.widths_us)],
            "angles_deg": [*map(list, self.angles_deg)],
            "periods_ms": self.periods_ms and list(self.periods_ms),
            "stays_s": self.stays_s and list(self.stays_s),
            "silent_s": self.silent_s and list(self.silent_s),
            "asked_pause_s": self.pause_s,
        }


@dataclass(frozen=True, slots=True)
class Grade:
    """The result for a program: it passed if it does what the lab requires, without any fault."""

    lab: str
    faults: tuple[Fault, ...]
    """The faults, the most helpful one first."""
    unchecked: tuple[Check, ...] = ()
    """The checks that could not be made because of the faults."""
    remarks: tuple[Diagnostic, ...] = ()
    """Notes on a program, whether right or wrong."""
    pins: tuple[tuple[str, str], ...] = ()
    """(servo, the pin with its pulses)."""
    rows: tuple[Row, ...] = ()
    seen: str = ""
    """The program's order of positions."""
    watched_s: float = 0.0
    rounds: tuple[int, ...] = ()
    """The cycles in which a round begins: at the first of the solution's positions."""
    repeats: bool = False
    """Whether the whole state of each chip was seen to repeat at the beginnings of two rounds, so that the
    motion continues endlessly."""
    chips: int = 1
    """The number of different chips on which the program was powered up."""
    moment: int | None = None
    """The cycle in which the first fault begins, if it has a moment."""
    film: Film | None = None
    """The film around that moment."""

    @property
    def passed(self) -> bool:
        return not self.faults

    @property
    def how_long(self) -> str:
        """Return for how long a correct program was watched; empty if it was seen to repeat."""
        return next((remark.message for remark in self.remarks if remark.code == "not-repeated"), "")

    @property
    def reasons(self) -> tuple[str, ...]:
        """Return the faults as sentences for students; nothing is decided by them."""
        return tuple(fault.text for fault in self.faults)

    def to_json(self) -> GradeFacts:
        """Return the grade as plain values for JSON."""
        return {
            "lab": self.lab,
            "passed": self.passed,
            "reasons": list(self.reasons),
            "remarks": [remark.to_json() for remark in self.remarks],
            "pins": dict(self.pins),
            "positions": [row.to_json() for row in self.rows],
            "seen": self.seen,
            "watched_s": self.watched_s,
            "repeats": self.repeats,
            "chips": self.chips,
        }


CHECKS = tuple(Check)


def refused(lab: str, *reasons: str) -> Grade:
    """Return the grade of a program that could not be run."""
    return Grade(lab, tuple(Fault((Check.RUNS,), text) for text in reasons), CHECKS[1:])


def _without_pulses(lab: Lab, seconds: float, *reasons: str) -> Grade:
    """Return the grade of a program that ran, but whose pulses cannot be judged."""
    faults = tuple(Fault((Check.PULSES,), text) for text in reasons)
    return Grade(lab.name, faults, CHECKS[CHECKS.index(Check.PULSES) + 1 :], watched_s=seconds)


MAX_WIRINGS = 64
"""The most wirings that are tried, each with all solutions; four servos on four free pins have 24."""


def judge(lab: Lab, watched: Watched, chip: ChipFacts) -> Grade:
    """Return the grade of a program that was watched."""
    seconds = float(watched.clock.seconds(watched.end))
    why = cause(lab, watched, chip)
    if why is not None:
        return _without_pulses(lab, seconds, why)
    silent = tuple(silent_reasons(lab, watched, chip))
    if silent:
        return _without_pulses(lab, seconds, *silent)
    grades = [
        _judge_solution(_attempt(lab, solution, watched, chip, pins))
        for pins in _wirings(lab, watched)
        for solution in lab.solutions
    ]
    best = min(grades, key=_severity)
    return best if best.passed else _if_swapped(lab, watched, chip, best)


def _severity(grade: Grade) -> tuple[bool, bool, int]:
    """Return what is less for the grade that says more: right positions in order say what is meant."""
    failed = {check for fault in grade.faults for check in fault.checks}
    return not grade.passed, not failed.isdisjoint({Check.ORDER, Check.POSITIONS}), len(grade.reasons)


def _if_swapped(lab: Lab, watched: Watched, chip: ChipFacts, found: Grade) -> Grade:
    """Return the grade, with a question if the program is right for servos on each other's pins.

    No more than that: two servos that take turns are as wrong if they turn backwards.
    """
    pins = [PINS.index(servo.pins[0]) for servo in lab.servos]
    if any(pin not in watched.pins for pin in pins):
        return found
    for others in islice(permutations(pins), 1, MAX_WIRINGS):
        attempts = (_attempt(lab, solution, watched, chip, others) for solution in lab.solutions)
        if any(_judge_solution(attempt).passed for attempt in attempts):
            swapped = " and ".join(
                f"'{servo.servo.name}' were on {PINS[pin]}"
                for servo, pin in zip(lab.servos, others, strict=True)
                if PINS[pin] != servo.pins[0]
            )
            first = found.faults[0]
            asked = f"{first.text}. It would be right if {swapped}: are their pins swapped?"
            return replace(found, faults=(replace(first, text=asked), *found.faults[1:]))
    return found


def _wirings(lab: Lab, watched: Watched) -> Iterator[tuple[int, ...]]:
    """Yield the pins that the servos may be on: the lab's own if it has pulses, else any allowed one."""
    choices = []
    for servo in lab.servos:
        active = [PINS.index(pin) for pin in servo.pins if PINS.index(pin) in watched.pins]
        choices.append(active[:1] if PINS[active[0]] == servo.pins[0] else active)
    count = 0
    for pins in product(*choices):
        if len(set(pins)) == len(pins) and count < MAX_WIRINGS:
            count += 1
            yield pins


def _attempt(
    lab: Lab, solution: Solution, watched: Watched, chip: ChipFacts, numbers: Sequence[int]
) -> Attempt:
    return Attempt(lab, solution, watched, chip, {PINS[number]: watched.pins[number] for number in numbers})


def _judge_solution(attempt: Attempt) -> Grade:
    lab, solution, watched = attempt.lab, attempt.solution, attempt.watched
    servos = [lab_servo.servo for lab_servo in lab.servos]
    everything = visits(watched, attempt.pulses, servos, solution.positions)
    longest_move = int(lab.longest_move_s * watched.clock.cycles_per_second)
    settled, placed, slow_or_fast = _in_order(everything, longest_move, solution)
    right = stays(attempt, settled, placed)
    faults = (
        *order_faults(attempt, settled, placed),
        *(move_faults(attempt, right) if slow_or_fast else ()),
        *pause_faults(attempt, right),
        *travel_faults(attempt, everything, right),
        *period_faults(attempt, right),
        *interruption_faults(attempt, right),
        *end_faults(attempt, settled),
    )
    clock = clock_words(lab, attempt.chip)
    if faults and clock:  # all else that is wrong is a consequence
        failed = {check for fault in faults for check in fault.checks}
        faults = (Fault(tuple(check for check in Check if check in failed), clock),)
    return Grade(
        lab=lab.name,
        faults=faults,
        unchecked=(*_unseen_visits(solution, settled, right), *([Check.CHIPS] if faults else [])),
        remarks=tuple(_remarks(attempt)),
        pins=tuple((servo.name, pin) for servo, pin in zip(servos, attempt.pins, strict=True)),
        rows=tuple(_rows(attempt, right)),
        seen=sequence(settled, solution),
        watched_s=float(watched.clock.seconds(watched.end)),
        rounds=tuple(stay.visit.begin for stay in right if stay.position == 0),
        moment=first_wrong(attempt, settled, placed, right) if faults else None,
    )


def _in_order(
    everything: Sequence[Visit], longest_move: int, solution: Solution
) -> tuple[list[Visit], VisitOrder, bool]:
    """Return the visits to positions, their order, and whether only their speed is wrong.

    That is so where moves that last too long, or positions that are passed too quickly, come in the right
    order: a program whose times are wrong is not told that its order is.
    """
    brief = longest_move // 4
    settled = without_moves(everything, longest_move, brief)
    placed = order(settled, solution)
    if len(placed.right) < len(settled):
        for longest, passing in ((sys.maxsize, brief), (longest_move, 0), (sys.maxsize, 0)):
            found = without_moves(everything, longest, passing)
            other = order(found, solution)
            if len(other.right) == len(found) >= len(solution.positions):
                return found, other, True
    return settled, placed, False


def _unseen_visits(solution: Solution, stops: Sequence[Visit], right: Sequence[Stay]) -> Iterator[Check]:
    """Yield the checks for which too few visits were seen."""
    positions = frozenset(range(len(solution.positions)))
    whole = {stay.position for stay in right if stay.whole}
    if not positions.issubset(place for visit in stops for place in visit.places):
        yield Check.POSITIONS
    if len(stops) < len(positions):
        yield Check.ORDER
    if not whole.issuperset(number for number in positions if solution.positions[number].pause_s):
        yield Check.PAUSES
    if not whole.issuperset(positions):
        yield Check.TRAVEL
    if not right:
        yield Check.PERIOD


def _remarks(attempt: Attempt) -> Iterator[Diagnostic]:
    lab, solution = attempt.lab, attempt.solution
    for lab_servo, pin in zip(lab.servos, attempt.pins, strict=True):
        if pin != lab_servo.pins[0]:
            yield Diagnostic(
                "note",
                "other-pin",
                f"the servo '{lab_servo.servo.name}' is on {pin}, "
                f"not on the lab's {lab_servo.pins[0]}: wire it there",
            )
    others = [name for pin in sorted(attempt.watched.pins) if (name := PINS[pin]) not in attempt.pins]
    if others:
        yield Diagnostic(
            "note", "other-pin", f"there are also pulses on {', '.join(others)}, where no servo is connected"
        )
    if len(lab.solutions) > 1 and solution.name:
        yield Diagnostic("note", "graded-as", f"graded as: {solution.name}")
    period = period_remark(attempt)
    if period:
        yield Diagnostic("note", "period-range", period)
    if not attempt.chip.configured:
        yield Diagnostic(
            "note",
            "no-configuration",
            "the program has no configuration word: an erased chip has its watchdog on",
        )


def _rows(attempt: Attempt, stays: Sequence[Stay]) -> Iterator[Row]:
    """Yield what was measured at each position of the task."""
    ms, servos = float(attempt.watched.clock.cycle_us) / 1000, len(attempt.pins)
    for number, position in enumerate(attempt.solution.positions):
        own = [stay for stay in stays if stay.position == number]
        commanded = [command for stay in own for command in stay.visit.commanded]
        periods = [
            value * ms
            for stay in own
            for pin in attempt.pulses
            for value in pin.periods(stay.visit.begin, stay.visit.end).tolist()
        ]
        whole = [stay for stay in own if stay.whole]
        yield Row(
            name=position.name,
            visits=len(own),
            widths_us=tuple(
                _ends([command.widths_us[servo] for command in commanded])
                for servo in range(servos)
                if commanded
            ),
            angles_deg=tuple(
                _ends([math.degrees(command.angles[servo]) for command in commanded])
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
