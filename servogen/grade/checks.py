"""The checks of a lab's task: the state of the chip, the order of positions, pauses, travel and periods.

In: a lab, the pulses that were watched and the visits found in them. Out: faults, as sentences for students.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from servogen.edges import PINS
from servogen.grade.lab import Check, Lab, Solution, TaskPosition
from servogen.grade.watch import Commanded, PinPulses, Turns, Visit, Watched
from servogen.pulse.lint import PERIOD_US
from servogen.robot.servo import Servo
from servogen.robot.servo_models import names as model_names
from servogen.robot.servo_models import servo_model
from servogen.units import counted

TURN_OFF = (
    "turn it off (C2C: asm __config 0x3FF1, XC8: #pragma config WDTE = OFF, assembly: __CONFIG _WDT_OFF)"
)


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that is wrong, as a sentence for a student, and the checks that fail because of it."""

    checks: tuple[Check, ...]
    text: str


@dataclass(frozen=True, slots=True)
class ChipFacts:
    """The chip at the end of the watch."""

    inputs: frozenset[int] = frozenset()
    """The pins that are inputs at the end."""
    watchdog_resets: int = 0
    configured: bool = True
    """Whether the program has a configuration word."""
    sleeping: bool = False
    lost: bool = False
    """Whether it ran into memory without a program."""
    stack_wraps: int = 0
    written_for_hz: int | None = None
    """The clock that the source states."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """A program's pulses, taken as one solution of the task with its servos on some of the allowed pins."""

    lab: Lab
    solution: Solution
    watched: Watched
    chip: ChipFacts
    pins: Mapping[str, PinPulses]
    """The pulses of each servo, by its pin."""

    @property
    def pulses(self) -> Sequence[PinPulses]:
        return tuple(self.pins.values())

    def name(self, position: int) -> str:
        """Return the name of a position."""
        return self.solution.positions[position].name


def cause(lab: Lab, watched: Watched, chip: ChipFacts) -> str | None:
    """Return the cause of which everything else that is wrong is a consequence, if there is one."""
    seconds = float(watched.clock.seconds(watched.end))
    if chip.watchdog_resets:
        why = "" if chip.configured else "the program has no configuration word, so the watchdog is on; "
        times = f"{chip.watchdog_resets} times" if chip.watchdog_resets > 1 else "once"
        return (
            f"the watchdog resets the chip {times} in {seconds:.3g} s: {why}{TURN_OFF}, or clear it in time"
        )
    if watched.too_fast:
        pin = max(watched.pins, key=lambda pin: len(watched.pins[pin].rise))
        edges = 2 * len(watched.pins[pin].rise)
        return f"{PINS[pin]} changes {edges} times in {seconds:.3g} s: these are not pulses for a servo"
    return None


def silent_reasons(lab: Lab, watched: Watched, chip: ChipFacts) -> Iterator[str]:
    """Yield why servos of the task get no pulses."""
    for servo in lab.servos:
        numbers = [PINS.index(pin) for pin in servo.pins]
        if any(number in watched.pins for number in numbers):
            continue
        yield _silent_reason(lab, watched, chip, servo.servo.name, numbers)


def _silent_reason(lab: Lab, watched: Watched, chip: ChipFacts, servo: str, pins: list[int]) -> str:
    own, text = PINS[pins[0]], f"there are no pulses for the servo '{servo}' on {PINS[pins[0]]}"
    stuck = next((pin for pin in pins if pin in watched.high_since), None)
    if stuck is not None:
        since = float(watched.clock.us(watched.high_since[stuck])) / 1000
        return f"{PINS[stuck]} goes high {since:.4g} ms after the start and stays high: a pulse must end"
    lab_pins = {PINS.index(lab_servo.pins[0]) for lab_servo in lab.servos}
    elsewhere = [PINS[pin] for pin in sorted(watched.pins) if pin not in lab_pins]
    if elsewhere:
        drain = ", which is an open drain and needs a pull-up resistor" if elsewhere == ["RA4"] else ""
        return f"{text}: the pulses are on {' and '.join(elsewhere)}{drain}"
    if pins[0] in chip.inputs:
        register = f"TRIS{own[1]}"
        return f"{text}: the pin is still an input; its bit in {register} (bank 1) must be 0"
    if chip.sleeping:
        return f"{text}: the chip is asleep"
    if chip.lost:
        return f"{text}: the program {PAST_ITS_END}"
    if chip.stack_wraps:
        return f"{text}: calls are nested deeper than the chip's 8 levels"
    hangs = "" if watched.pins else "; nor does another: the program hangs before that, or writes to inputs"
    return f"{text}: the pin is an output, but never goes high and low again{hangs}"


def clock_words(lab: Lab, chip: ChipFacts) -> str | None:
    """Return what is wrong if the source is written for another crystal."""
    if chip.written_for_hz in (None, lab.clock.hz):
        return None
    source, board = (f"{(hz or 0) / 1e6:g} MHz" for hz in (chip.written_for_hz, lab.clock.hz))
    return (
        f"the program is written for a crystal of {source}, but the board has {board}: "
        "all its times are wrong"
    )


PAST_ITS_END = "runs on past its end; it needs an endless loop"

ROUNDED = 6
"""The decimals of a period, so that one exactly at a limit is allowed."""

ARROW = " → "
SHOWN_ROUNDS = 2
"""The rounds of a task whose positions are named: the second shows whether a motion repeats."""


@dataclass(frozen=True, slots=True)
class VisitOrder:
    """Which position each visit should be at; `right` are the numbers of the visits that are there."""

    asked: tuple[int, ...]
    right: tuple[int, ...]


def order(visits: Sequence[Visit], solution: Solution) -> VisitOrder:
    """Return the order with the most correct visits; a round may begin at any of its positions."""
    size = len(solution.positions)
    tries = []
    for first in range(size):
        asked = tuple((first + index) % size for index in range(len(visits)))
        right = tuple(index for index, visit in enumerate(visits) if asked[index] in visit.places)
        tries.append(VisitOrder(asked, right))
    return max(tries, key=lambda order: len(order.right))


def order_faults(attempt: Attempt, visits: Sequence[Visit], found_order: VisitOrder) -> Iterator[Fault]:
    """Yield what is wrong with the order or with the positions."""
    lab, solution = attempt.lab, attempt.solution
    right = set(found_order.right)
    wrong = [index for index in range(len(visits)) if index not in right]
    strange = [index for index in wrong if not visits[index].places]
    if len(strange) == len(wrong) and len(wrong) < len(visits):
        asked: dict[int, int] = {}
        for index in strange:
            asked.setdefault(found_order.asked[index], index)
        for position, index in sorted(asked.items()):
            name = solution.positions[position].name
            text = f"where {name} is expected, {_strange(visits[index], lab, solution, position)}"
            yield Fault((Check.POSITIONS,), text)
    elif wrong:
        positions = [position.name for position in solution.positions]
        text = f"the order is {sequence(visits, solution)}; it should be {ARROW.join(positions)}, repeatedly"
        yield Fault((Check.ORDER,), text)
        seen: set[tuple[float, ...]] = set()
        for index in strange:
            if visits[index].commanded[0].widths_us not in seen and len(seen) < len(solution.positions):
                text = f"not a position of the task: {_strange(visits[index], lab, solution, None)}"
                yield Fault((Check.POSITIONS,), text)
            seen.add(visits[index].commanded[0].widths_us)


def sequence(visits: Sequence[Visit], solution: Solution) -> str:
    """Return the names of the first visits."""
    count = SHOWN_ROUNDS * len(solution.positions)
    words = [_name(visit, solution) for visit in visits[:count]]
    return ARROW.join([*words, *(["…"] if len(visits) > count else [])])


def _name(visit: Visit, solution: Solution) -> str:
    if visit.places:
        return solution.positions[min(visit.places)].name
    return " and ".join(f"{width:g} µs" for width in visit.commanded[0].widths_us)


def _strange(visit: Visit, lab: Lab, solution: Solution, position: int | None) -> str:
    """Return the pulses of a visit: those of the wrong angles, if the expected ones are known."""
    given = visit.commanded[0]
    positions = solution.positions if position is None else (solution.positions[position],)
    words = []
    for number, lab_servo in enumerate(lab.servos):
        ranges = [wanted.ranges[number] for wanted in positions]
        if not any(low <= given.angles[number] <= high for low, high in ranges):
            words.append(_pulse_words(lab_servo.servo, given, number, ranges))
    together = [
        _pulse_words(lab_servo.servo, given, number, ()) for number, lab_servo in enumerate(lab.servos)
    ]
    return ", and ".join(words or together)


def _pulse_words(servo: Servo, given: Commanded, number: int, asked: Sequence[tuple[float, float]]) -> str:
    width, angle = given.widths_us[number], given.angles[number]
    shortest, longest = servo.widths_us
    text = f"'{servo.name}' gets pulses of {width:g} µs, which is {math.degrees(angle):.1f}°"
    if not servo.allows(angle):
        takes = f"the {servo.model.title} takes {shortest:g} to {longest:g} µs"
        return f"'{servo.name}' gets pulses of {width:g} µs; {takes}"
    models = [servo_model(name) for name in model_names()]
    # Many servos take the same widths: those of the labs are the likeliest in a lab.
    for model in sorted(models, key=lambda model: not model.source.startswith("lab:")):
        if model.name == servo.model.name or model.continuous:
            continue
        if any(low <= model.calibration.angle(width) <= high for low, high in asked):
            return f"{text} on the {servo.model.title} (the width is that of the {model.title})"
    return text


class Stay(NamedTuple):
    """A visit at the position where it should be. Times in seconds."""

    position: int
    visit: Visit
    stays_s: float
    silent_s: float
    whole: bool
    """Whether the visit ended before the watch did."""


def stays(attempt: Attempt, visits: Sequence[Visit], placed: VisitOrder) -> list[Stay]:
    """Return the visits that are at the positions where they should be."""
    second = float(attempt.watched.clock.cycles_per_second)
    stays = []
    for index in placed.right:
        visit = visits[index]
        silent = min(pin.silence(visit.begin, visit.end) for pin in attempt.pulses)
        stays.append(
            Stay(
                position=placed.asked[index],
                visit=visit,
                stays_s=visit.cycles / second,
                silent_s=silent / second,
                whole=index < len(visits) - 1,
            )
        )
    return stays


def pause_faults(attempt: Attempt, stays: Sequence[Stay]) -> Iterator[Fault]:
    """Yield the worst pause of each position that has a wrong one."""
    for number, position in enumerate(attempt.solution.positions):
        own = [stay for stay in stays if stay.position == number and stay.whole]
        if position.pause_s is None or not own:
            continue
        worst = max(own, key=lambda stay: _pause_error(stay, position))
        if _pause_error(worst, position) > attempt.lab.pause_tolerance * position.pause_s:
            yield Fault((Check.PAUSES,), _pause_words(worst, position))


def first_wrong(
    attempt: Attempt, visits: Sequence[Visit], placed: VisitOrder, right: Sequence[Stay]
) -> int | None:
    """Return the cycle in which the first visit begins, or ends, that is wrong; None if all are right."""
    wrong = sorted(set(range(len(visits))) - set(placed.right))
    moments = [visits[wrong[0]].begin] if wrong else []
    for stay in right:
        position = attempt.solution.positions[stay.position]
        required = position.pause_s
        if (
            stay.whole
            and required is not None
            and _pause_error(stay, position) > attempt.lab.pause_tolerance * required
        ):
            moments.append(stay.visit.end)
            break
    return min(moments, default=None)


def _pause_error(stay: Stay, position: TaskPosition) -> float:
    asked = position.pause_s or 0.0
    return min(abs(stay.stays_s - asked), abs(stay.silent_s - asked))


def _pause_words(stay: Stay, position: TaskPosition) -> str:
    asked = f"the pause should be {position.pause_s:g} s"
    if stay.silent_s:
        return f"after {position.name} there are no pulses for {stay.silent_s:.2f} s; {asked}"
    return f"it stays at {position.name}, with pulses, for {stay.stays_s:.2f} s; {asked}"


def move_faults(attempt: Attempt, stays: Sequence[Stay]) -> Iterator[Fault]:
    """Yield the longest move to each position if it lasts too long, and positions that are only passed."""
    lab, solution = attempt.lab, attempt.solution
    second = float(attempt.watched.clock.cycles_per_second)
    passed: dict[int, Stay] = {}
    for stay in stays:
        brief = stay.whole and 4 * stay.stays_s <= lab.longest_move_s
        if brief and solution.positions[stay.position].pause_s is None:
            passed.setdefault(stay.position, stay)
    for position, stay in sorted(passed.items()):
        text = f"it passes through {attempt.name(position)} in {stay.stays_s:.2f} s, too fast to be a stop"
        yield Fault((Check.TRAVEL,), text)
    moves: dict[tuple[int, int], float] = {}
    for before, after in pairwise(stays):
        way = before.position, after.position
        moves[way] = max(moves.get(way, 0.0), (after.visit.begin - before.visit.end) / second)
    for (start, end), seconds in sorted(moves.items()):
        if seconds > lab.longest_move_s:
            names = " to ".join(map(attempt.name, (start, end)))
            text = f"the move from {names} lasts {seconds:.2f} s; it may last {lab.longest_move_s:g} s"
            yield Fault((Check.TRAVEL,), text)


def travel_faults(attempt: Attempt, everything: Sequence[Visit], stays: Sequence[Stay]) -> Iterator[Fault]:
    """Yield positions that a servo cannot have reached: without pulses it does not move."""
    before = {after.begin: visit.commanded[-1].angles for visit, after in pairwise(everything)}
    named: set[tuple[int, int]] = set()
    second = float(attempt.watched.clock.cycles_per_second)
    for stay in stays:
        for number, (lab_servo, pin) in enumerate(zip(attempt.lab.servos, attempt.pulses, strict=True)):
            speed = lab_servo.servo.model.speed
            start = before.get(stay.visit.begin)
            if speed is None or start is None or not stay.whole or not lab_servo.servo.allows(start[number]):
                continue
            turn = abs(stay.visit.commanded[-1].angles[number] - start[number])
            needed = turn / speed
            given = stay.stays_s - pin.silence(stay.visit.begin, stay.visit.end) / second
            if given + 2 * pin.period / second < needed and (stay.position, number) not in named:
                named.add((stay.position, number))
                text = (
                    f"the pulses for {attempt.name(stay.position)} last {given:.2f} s: "
                    f"a {lab_servo.servo.model.title} needs {needed:.2f} s to get there"
                )
                yield Fault((Check.TRAVEL,), text)


def period_faults(attempt: Attempt, stays: Sequence[Stay]) -> Iterator[Fault]:
    """Yield each pin's period farthest outside the range, and its largest change within a position."""
    ms = float(attempt.watched.clock.cycle_us) / 1000
    lab = attempt.lab
    low, high = lab.period_ms
    for name, pin in attempt.pins.items():
        outside, changing = (0.0, ""), (0.0, "")
        for stay in stays:
            periods = pin.periods(stay.visit.begin, stay.visit.end) * ms
            if not len(periods):
                continue
            shortest, longest = float(periods.min()), float(periods.max())
            where = attempt.name(stay.position)
            beyond = round(max(low - shortest, longest - high), ROUNDED)
            if beyond > outside[0]:
                value = longest if longest - high >= low - shortest else shortest
                outside = (beyond, f"the period on {name} at {where} is {value:.2f} ms")
            if longest - shortest > changing[0]:
                drift = (
                    "drifts"
                    if bool(np.all(np.diff(periods) >= 0) or np.all(np.diff(periods) <= 0))
                    else "varies"
                )
                changing = (
                    longest - shortest,
                    f"the period on {name} {drift} at {where}: {shortest:.3f} to {longest:.3f} ms",
                )
        if outside[0] > 0:
            yield Fault((Check.PERIOD,), f"{outside[1]}; it should be {low:g} to {high:g} ms")
        if round(changing[0] * 1000, ROUNDED) > lab.spread_us:
            yield Fault((Check.PERIOD,), f"{changing[1]}; it may vary by {lab.spread_us:g} µs at most")


def interruption_faults(attempt: Attempt, stays: Sequence[Stay]) -> Iterator[Fault]:
    """Yield each pin's longest pause that is followed by pulses for the same position, if there is one.

    At its first position a program may wait before its endless loop.
    """
    pins = attempt.pulses
    turns = [pin.turns() for pin in pins]
    for number, name in enumerate(attempt.pins):
        longest, where = max(
            (
                (again - last, stay.position)
                for stay in stays[1:]
                for last, again in turns[number].pauses(stay.visit.begin, stay.visit.end)
                if not _waits_for_others(number, (last, again), stay.visit.end, pins, turns)
            ),
            default=(0, 0),
        )
        if longest:
            seconds = float(attempt.watched.clock.seconds(longest))
            on = f" on {name}" if len(pins) > 1 else ""
            text = (
                f"the pulses{on} for {attempt.name(where)} stop, and go on {seconds:.2f} s later; "
                "a pause comes after the last one"
            )
            yield Fault((Check.PERIOD,), text)


def _waits_for_others(
    number: int, pause: tuple[int, int], end: int, pins: Sequence[PinPulses], turns: Sequence[Turns]
) -> bool:
    """Return whether a servo, at a position up to `end`, pauses because of the other servos.

    Either the pulse after the pause is in the frame in which another servo changes its position:

        vertical    ┤ P P P │ silence │ P P P ···        the second position begins with horizontal's pulse
        horizontal  ┤ P P P │ silence │  Q Q Q ···

    or the servos get their pulses in turns; another pause is then between two positions:

        vertical    ┤ P P P │       │ P P P │       │ silence │ P P P │
        horizontal  ┤       │ P P P │       │ P P P │ silence │       │ Q Q Q ···
    """
    own, (last, again) = pins[number], pause
    others = [index for index in range(len(pins)) if index != number]
    changed = [index for index in others if end in pins[index].rise]
    if changed and again + own.period >= end and end not in own.rise:
        return True
    taking = [index for index in others if turns[index].has_between(last, again)]
    if any(not len(pins[index].rises(again, end)) for index in taking if index in changed):
        return True
    rises = np.sort(np.concatenate([pin.rises(last, again + 1) for pin in pins]))
    return bool(taking) and int(np.diff(rises).max()) <= own.longest_period


def period_remark(attempt: Attempt) -> str | None:
    """Return a note on a period that the lab allows but that is not recommended."""
    periods = [float(attempt.watched.clock.us(pin.period)) for pin in attempt.pulses if pin.period]
    low, high = (value / 1000 for value in PERIOD_US)
    for period in periods:
        if not low - 0.5 <= period / 1000 <= high + 0.5:
            return f"the period is {period / 1000:.2f} ms; {low:g} to {high:g} ms are recommended"
    return None


def end_faults(attempt: Attempt, visits: Sequence[Visit]) -> Iterator[Fault]:
    """Yield why there are fewer complete rounds than required, or why they only seem to repeat endlessly."""
    text = _end_words(attempt, visits)
    if text is None and attempt.chip.lost:
        text = f"the program {PAST_ITS_END}"
    if text:
        yield Fault((Check.REPETITION,), text)


def _end_words(attempt: Attempt, visits: Sequence[Visit]) -> str | None:
    lab, watched, solution = attempt.lab, attempt.watched, attempt.solution
    rounds = max(0, len(visits) - 1) // len(solution.positions)
    longest = max(position.pause_s or 1.0 for position in solution.positions)
    if rounds >= lab.rounds:
        # It has shown how long it stays at a position.
        own = max(visit.cycles for visit in visits[:-1])
        return _stop_words(attempt, visits, max(longest, float(watched.clock.seconds(own))))
    seconds = float(watched.clock.seconds(watched.end))
    whole = "no complete round" if not rounds else f"only {counted(rounds, 'complete round')}"
    text = f"{whole} in {seconds:g} s instead of {lab.rounds} or more"
    stop = _stop_words(attempt, visits, longest)
    return f"{text}: {stop}" if stop else text


def _stop_words(attempt: Attempt, visits: Sequence[Visit], longest: float) -> str | None:
    """Return that the motion ends if it does: after twice the `longest` time at a position, in seconds."""
    watched, last = attempt.watched, max(int(pin.fall[-1]) for pin in attempt.pulses)
    if float(watched.clock.seconds(watched.end - last)) > 2 * longest:
        end = float(watched.clock.seconds(last))
        return f"the pulses stop after {end:.1f} s; the motion must repeat endlessly"
    if visits and float(watched.clock.seconds(visits[-1].cycles)) > 2 * longest:
        begin = float(watched.clock.seconds(visits[-1].begin))
        return f"after {begin:.1f} s nothing moves; the motion must repeat endlessly"
    return None
