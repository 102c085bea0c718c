"""Each check of a lab at its limit, with visits written by hand, and the sentence that a student reads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from servogen.edges import PINS, EdgeTrace, edge_chunk
from servogen.grade import ChipFacts, Grade, judge, load_lab
from servogen.grade.checks import (
    Attempt,
    Fault,
    Stay,
    VisitOrder,
    cause,
    clock_words,
    end_faults,
    first_wrong,
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
from servogen.grade.lab import Check, Lab, Solution, TaskPosition
from servogen.grade.points import CheckState, headline, max_total, number, outcomes, total
from servogen.grade.watch import MAX_EDGES, Commanded, PinPulses, Visit, Watched, visits, watch, without_moves
from servogen.pulse.lint import PERIOD_US
from servogen.units import Clock, Cycles
from tests.grade.test_judge import RIGHT, grade, pulses

MHZ4 = Clock(4_000_000)
LAB8 = load_lab("lab8-exercise")
SERVO = LAB8.servos[0]
RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")


def radians(*degrees: float) -> tuple[float, ...]:
    return tuple(math.radians(each) for each in degrees)


def position(name: str, low: float, high: float, pause_s: float | None = None) -> TaskPosition:
    return TaskPosition(name, ((math.radians(low), math.radians(high)),), pause_s)


TASK = Solution(
    "the way there", (position("A", 25, 35, 2.0), position("B", 85, 95, None), position("C", 115, 125, 4.0))
)
LAB: Lab = replace(
    LAB8, solutions=(TASK,), pause_tolerance=0.05, period_ms=(18.0, 22.0), spread_us=100.0, rounds=2
)


def commanded(cycle: int, degrees: float, width: float = 1500.0) -> Commanded:
    return Commanded(cycle, radians(degrees), (width,))


def visit(begin: int, end: int, places: Sequence[int], degrees: float = 30.0, width: float = 1500.0) -> Visit:
    return Visit(begin, end, frozenset(places), (commanded(begin, degrees, width),))


def pin(*rises: int, width: int = 1500) -> PinPulses:
    rise = np.array(rises, dtype=np.int64)
    return PinPulses(rise, rise + width)


def watched(pins: dict[int, PinPulses] | None = None, end: int = 10_000_000, **changes: object) -> Watched:
    return Watched(MHZ4, end, pins or {}, **{"high_since": {}, "too_fast": False, **changes})  # type: ignore[arg-type]


def attempt(*pins: PinPulses, end: int = 10_000_000) -> Attempt:
    return Attempt(LAB, TASK, watched(end=end), ChipFacts(), dict(zip(("RB0", "RB1"), pins, strict=False)))


# Pulses and visits


def test_a_pause_is_longer_than_three_periods() -> None:
    steady = pin(0, 1000, 2000, 3000, 6000, 7000, width=100)
    assert (steady.period, steady.longest_period) == (1000, 3000)
    assert steady.silence(0, 7100) == 0
    assert steady.silence(0, 7109) == 9
    assert steady.periods(0, 10_000).tolist() == [1000, 1000, 1000, 3000, 1000]
    paused = pin(0, 1000, 2000, 3000, 6001, 7000, width=100)
    assert paused.silence(0, 10_000) == 6001 - 3100
    assert paused.periods(0, 10_000).tolist() == [1000, 1000, 1000, 999]
    assert paused.silence(0, 4000) == 900
    assert [paused.silence(begin, 9000) for begin in (3100, 3101)] == [2901, 1900]
    assert [paused.silence(0, end) for end in (3100, 3101)] == [0, 1]
    assert paused.periods(1000, 3000).tolist() == [1000]
    assert paused.periods(1001, 3001).tolist() == [1000]
    assert (pin(5).period, pin(5).periods(0, 99).tolist()) == (0, [])


def test_a_watch_has_whole_pulses_and_what_stays_high() -> None:
    rows = [(5, RB1, 1), (10, RB0, 1), (1000, RB0, 0), (1050, RB0, 1)]
    seen = watch(EdgeTrace(MHZ4, (edge_chunk(*zip(*rows, strict=True)),), Cycles(1099)))
    assert (seen.end, seen.too_fast, dict(seen.high_since)) == (1099, False, {RB0: 1050, RB1: 5})
    assert list(seen.pins) == [RB0]
    assert (seen.pins[RB0].rise.tolist(), seen.pins[RB0].fall.tolist()) == ([10], [1000])


@pytest.mark.parametrize(("width", "rises"), [(250, [9000]), (251, [10, 9000])])
def test_what_a_latch_shows_before_it_is_first_written_is_no_pulse(width: int, rises: list[int]) -> None:
    """250 µs or less, and only the first of a pin: any later pulse that is too short is a fault."""
    rows = [(10, RB0, 1), (10 + width, RB0, 0), (9000, RB0, 1), (9100, RB0, 0)]
    seen = watch(EdgeTrace(MHZ4, (edge_chunk(*zip(*rows, strict=True)),), Cycles(9999)))
    assert seen.pins[RB0].rise.tolist() == rises
    alone = watch(EdgeTrace(MHZ4, (edge_chunk(*zip(*rows[:2], strict=True)),), Cycles(9999)))
    assert (list(alone.pins), dict(alone.high_since)) == ([RB0] if width > 250 else [], {})


@pytest.mark.parametrize(("more", "too_fast"), [(0, False), (1, True)])
def test_a_watch_is_given_up_beyond_a_million_edges(more: int, too_fast: bool) -> None:
    size = MAX_EDGES + more
    level = np.arange(1, size + 1) % 2
    chunk = edge_chunk(np.arange(size), np.full(size, RB0), level)
    seen = watch(EdgeTrace(MHZ4, (chunk,), Cycles(2 * size)))
    assert seen.too_fast == too_fast
    assert seen.end == (size - 1 if too_fast else 2 * size)


def test_visits_are_of_the_positions_that_the_servos_are_commanded_to() -> None:
    """90° is 1500 µs, and a visit goes on while its position holds."""
    width = {30: 1167, 31: 1172, 90: 1500}
    rise = [1000, 21_000, 41_000, 61_000, 81_000]
    fall = [r + width[d] for r, d in zip(rise, (30, 31, 90, 90, 30), strict=True)]
    own = PinPulses(np.array(rise), np.array(fall))
    found = visits(watched(end=99_000), [own], [SERVO.servo], TASK.positions)
    assert [(each.begin, each.end, set(each.places)) for each in found] == [
        (1000, 41_000, {0}),
        (41_000, 81_000, {1}),
        (81_000, 99_000, {0}),
    ]
    assert [[round(math.degrees(one.angles[0])) for one in each.commanded] for each in found] == [
        [30, 31],
        [90],
        [30],
    ]
    assert found[0].cycles == 40_000


@pytest.mark.parametrize(("late", "between"), [(0, []), (1, [(41_000, 41_001, set())])])
def test_two_servos_that_change_in_the_same_cycle_are_at_no_place_between(
    late: int, between: list[tuple[int, int, set[int]]]
) -> None:
    """Both go from 30° to 90° in the third frame, the second one `late` cycles after the first."""
    widths = np.array([1167, 1167, 1500, 1500])
    first = np.array([1000, 21_000, 41_000, 61_000])
    second = first + np.array([0, 0, late, late])
    pins = [PinPulses(rise, rise + widths) for rise in (first, second)]
    positions = [
        TaskPosition(each.name, 2 * each.ranges, None) for each in TASK.positions if each.name in "AB"
    ]
    found = visits(watched(end=81_000), pins, [SERVO.servo, SERVO.servo], positions)
    assert [(each.begin, each.end, set(each.places)) for each in found] == [
        (1000, 41_000, {0}),
        *between,
        (41_000 + late, 81_000, {1}),
    ]


def test_a_ramp_between_two_positions_is_no_visit_if_it_is_short_enough() -> None:
    stops = [visit(0, 100, [0], 30), visit(100, 200, [], 60), visit(200, 300, [1], 90)]
    assert without_moves(stops, 100) == [stops[0], stops[2]]
    assert without_moves(stops, 99) == stops
    beyond = [stops[0], visit(100, 200, [], 91), stops[2]]
    assert without_moves(beyond, 100) == beyond
    ends = [visit(0, 100, [], 60), visit(100, 200, [1], 90), visit(200, 300, [], 60)]
    assert without_moves(ends, 100) == ends
    at_the_ends = [stops[0], visit(100, 200, [], 90), stops[2]]
    assert without_moves(at_the_ends, 100) == [stops[0], stops[2]]


def test_a_position_that_a_ramp_passes_through_is_part_of_it() -> None:
    """For up to a quarter of the longest move."""
    through = [
        visit(0, 100, [0], 30),
        visit(100, 140, [], 60),
        visit(140, 165, [1], 90),
        visit(165, 200, [], 100),
        visit(200, 300, [2], 120),
    ]
    assert without_moves(through, 100) == [through[0], through[4]]
    longer = [*through[:2], visit(140, 166, [1], 90), visit(166, 200, [], 100), through[4]]
    assert without_moves(longer, 100) == [longer[0], longer[2], longer[4]]


def test_a_strange_visit_is_split_where_its_angles_jump() -> None:
    """0.07 rad are 4.01 degrees."""
    for jump, parts in ((4.0, [(100, 400)]), (4.02, [(100, 250), (250, 400)])):
        strange = Visit(100, 400, frozenset(), (commanded(100, 50), commanded(250, 50 + jump)))
        found = without_moves([strange], 0)
        assert [(each.begin, each.end) for each in found] == parts
        assert [len(each.commanded) for each in found] == ([2] if len(parts) == 1 else [1, 1])
        kept = Visit(100, 400, frozenset({1}), strange.commanded)
        assert without_moves([kept], 0) == [kept]


# Order and positions


def faults(stops: Sequence[Visit]) -> list[Fault]:
    return list(order_faults(attempt(), stops, order(stops, TASK)))


def test_a_strange_position_is_named_where_another_is_expected() -> None:
    assert faults([visit(0, 10, [0]), visit(10, 20, [1]), visit(20, 30, [2])]) == []
    round_trip = [
        visit(0, 10, [0]),
        visit(10, 20, [], 60, 1333),
        visit(20, 30, [2]),
        visit(30, 40, [0]),
        visit(40, 50, [], 70, 1389),
    ]
    assert faults(round_trip) == [
        Fault(
            (Check.POSITIONS,),
            f"where B is expected, '{SERVO.servo.name}' gets pulses of 1333 µs, which is 60.0°",
        )
    ]


def test_a_wrong_order_is_said_with_what_was_seen() -> None:
    stops = [visit(10 * n, 10 * n + 10, [place]) for n, place in enumerate((0, 2, 1, 0, 2, 1, 0))]
    assert faults(stops) == [
        Fault(
            (Check.ORDER,),
            "the order is A → C → B → A → C → B → …; it should be A → B → C, repeatedly",
        )
    ]
    mixed = [
        *stops[:6],
        visit(60, 70, [], 60, 1333),
        visit(70, 80, [], 60, 1333),
        visit(80, 90, [], 70, 1389),
    ]
    found = faults(mixed)
    assert [fault.checks for fault in found] == [(Check.ORDER,), (Check.POSITIONS,), (Check.POSITIONS,)]
    assert found[1].text.startswith("not a position of the task: ")
    assert "1333 µs" in found[1].text
    assert "1389 µs" in found[2].text
    many = [*stops[:6], *(visit(60 + n, 61 + n, [], 60, 1300.0 + n) for n in range(5))]
    assert len(faults(many)) == 1 + 3, "no more than the task has positions"


def test_the_first_two_rounds_are_written_out() -> None:
    stops = [visit(n, n + 1, [n % 3]) for n in range(6)]
    assert sequence(stops, TASK) == "A → B → C → A → B → C"
    assert sequence([*stops, visit(6, 7, [0])], TASK) == "A → B → C → A → B → C → …"
    assert sequence([visit(0, 1, [2, 1]), visit(1, 2, [], 60, 1333.5)], TASK) == "B → 1333.5 µs"


@pytest.mark.parametrize(
    ("degrees", "width", "text"),
    [
        (60.0, 1333, "gets pulses of 1333 µs, which is 60.0°"),
        (-400.0, 90, "gets pulses of 90 µs; the "),
    ],
)
def test_a_width_that_no_servo_takes_is_said(degrees: float, width: float, text: str) -> None:
    stops = [visit(0, 10, [0]), visit(10, 20, [], degrees, width), visit(20, 30, [2])]
    (fault,) = faults(stops)
    assert text in fault.text
    if degrees < 0:
        low, high = SERVO.servo.widths_us
        assert fault.text.endswith(f"takes {low:g} to {high:g} µs")


def test_a_width_that_another_model_takes_for_the_position_is_said() -> None:
    """1333 µs are 30° of a Tiny-S (1250 µs and 500 µs for 180°), and 60° of the S3001."""
    stops = [visit(0, 10, [], 60.0, 1333), visit(10, 20, [1]), visit(20, 30, [2]), visit(30, 40, [0])]
    (fault,) = faults(stops)
    assert fault.text == (
        f"where A is expected, '{SERVO.servo.name}' gets pulses of 1333 µs, "
        "which is 60.0° on the Futaba S3001 (the width is that of the Multiplex Tiny-S)"
    )


# Pauses, travel, periods, repetition


def stay(place: int, seconds: float, silent: float = 0.0, whole: bool = True, begin: int = 0) -> Stay:
    end = begin + round(1e6 * seconds)
    return Stay(place, visit(begin, end, [place]), seconds, silent, whole)


def texts(found: Sequence[Fault]) -> list[str]:
    return [fault.text for fault in found]


def test_a_pause_may_differ_by_its_tolerance() -> None:
    """2 s by 0.1 s, 4 s by 0.2 s; with or without pulses; B has none, and the last visit is not whole."""
    right = [
        stay(0, 1.9001),
        stay(0, 2.0999),
        stay(1, 99),
        stay(2, 9, 3.8001),
        stay(2, 4.1999),
        stay(0, 9, 0, False),
    ]
    assert list(pause_faults(attempt(), right)) == []
    wrong = [stay(0, 2.15), stay(0, 1.8), stay(0, 2), stay(2, 9, 4.21)]
    assert texts(list(pause_faults(attempt(), wrong))) == [
        "it stays at A, with pulses, for 1.80 s; the pause should be 2 s",
        "after C there are no pulses for 4.21 s; the pause should be 4 s",
    ]
    assert all(fault.checks == (Check.PAUSES,) for fault in pause_faults(attempt(), wrong))


def test_the_first_wrong_moment_is_that_of_a_visit_or_of_a_pauses_end() -> None:
    stops = [visit(10 * n, 10 * n + 10, [n % 3]) for n in range(3)]
    right = VisitOrder((0, 1, 2), (0, 1, 2))
    late = [stay(0, 2.0, begin=5), stay(2, 5.0, begin=7), stay(0, 9.0, begin=1)]
    assert first_wrong(attempt(), stops, right, late) == 7 + 5_000_000
    assert (
        first_wrong(attempt(), stops, right, [stay(0, 2.0), stay(1, 77.0), stay(2, 9, whole=False)]) is None
    )
    assert first_wrong(attempt(), stops, VisitOrder((0, 1, 2), (0,)), late) == 10
    assert first_wrong(attempt(), stops, VisitOrder((0, 1, 2), (0, 1)), [stay(0, 1.0, begin=-99)]) == 20


def test_stays_are_measured_with_their_longest_silence() -> None:
    stops = [visit(0, 1_000_000, [0]), visit(1_000_000, 3_000_000, [1])]
    own = pin(*range(0, 200_000, 20_000), *range(900_000, 1_200_000, 20_000))
    other = pin(*range(0, 400_000, 20_000), *range(900_000, 1_200_000, 20_000))
    found = stays(attempt(own, other), stops, VisitOrder((0, 1), (0, 1)))
    assert [(each.position, each.stays_s, each.whole) for each in found] == [(0, 1.0, True), (1, 2.0, False)]
    # The last pulses of the two begin at 180 and 380 ms; the shorter silence is 900 - 381.5 ms.
    assert found[0].silent_s == pytest.approx(0.5185)
    assert [each.position for each in stays(attempt(own), stops, VisitOrder((2, 1), (1,)))] == [1]


def travelled(given_s: float) -> list[str]:
    """From 30° to 120°: a quarter of a turn."""
    speed = SERVO.servo.model.speed
    assert speed is not None
    begin, needed = 1_000_000, math.radians(90) / speed
    end = begin + round(1e6 * given_s)
    before = visit(0, begin, [0], 30)
    there = Visit(begin, end, frozenset({2}), (commanded(begin, 120),))
    own = pin(*range(0, 3_000_000, 20_000))
    stops = [before, there, visit(end, end + 99, [0])]
    settled = [Stay(2, there, given_s, 0.0, True)]
    found = list(travel_faults(attempt(own), stops, settled))
    twice = list(travel_faults(attempt(own), stops, [*settled, *settled]))
    assert found == twice, "each position once"
    assert list(travel_faults(attempt(own), stops, [settled[0]._replace(whole=False)])) == []
    for fault in found:
        assert fault.checks == (Check.TRAVEL,)
        assert fault.text.endswith(f"needs {needed:.2f} s to get there")
    return texts(found)


def test_a_servo_needs_the_pulses_for_its_way_less_two_periods() -> None:
    speed = SERVO.servo.model.speed
    assert speed is not None
    needed = math.radians(90) / speed
    assert travelled(needed - 0.0399) == []
    (text,) = travelled(needed - 0.0401)
    assert text.startswith(f"the pulses for C last {needed - 0.0401:.2f} s: a ")


def periods(*lengths_us: int) -> list[str]:
    rises = np.cumsum([0, *lengths_us]).tolist()
    own = pin(*rises)
    settled = [Stay(1, visit(0, rises[-1] + 1, [1]), 9.0, 0.0, True)]
    found = list(period_faults(attempt(own), settled))
    assert all(fault.checks == (Check.PERIOD,) for fault in found)
    return texts(found)


def test_a_period_has_its_range_and_its_spread() -> None:
    assert periods(18_000, 18_100, 18_050) == []
    assert periods(22_000, 21_900, 21_950) == []
    assert periods(17_990, 18_050) == ["the period on RB0 at B is 17.99 ms; it should be 18 to 22 ms"]
    assert periods(22_010, 22_000) == ["the period on RB0 at B is 22.01 ms; it should be 18 to 22 ms"]
    assert periods(20_000, 20_101, 20_050) == [
        "the period on RB0 varies at B: 20.000 to 20.101 ms; it may vary by 100 µs at most"
    ]
    for drift in ((20_000, 20_050, 20_101), (20_101, 20_050, 20_000)):
        assert periods(*drift) == [
            "the period on RB0 drifts at B: 20.000 to 20.101 ms; it may vary by 100 µs at most"
        ]
    assert periods(17_000, 23_500)[0] == "the period on RB0 at B is 23.50 ms; it should be 18 to 22 ms"
    assert periods(16_000, 23_500)[0] == "the period on RB0 at B is 16.00 ms; it should be 18 to 22 ms"
    assert periods() == []


def test_a_period_that_is_allowed_but_unusual_is_remarked() -> None:
    """Within half a millisecond of the range that servogen's own warnings recommend."""
    low, high = PERIOD_US
    for period, said in ((low - 500, False), (low - 501, True), (high + 500, False), (high + 501, True)):
        own = pin(*range(0, 6 * period, period))
        text = f"the period is {period / 1000:.2f} ms; {low / 1000:g} to {high / 1000:g} ms are recommended"
        assert period_remark(attempt(own)) == (text if said else None)
    assert period_remark(attempt(pin(7))) is None


def test_too_few_rounds_are_said_with_the_moment_from_which_nothing_happens() -> None:
    """The longest pause is 4 s: twice as long without a pulse, or a move, is the end."""
    stops = [visit(1_000_000 * n, 1_000_000 * (n + 1), [n % 3]) for n in range(7)]

    def said(count: int, last: int, end: int) -> list[str]:
        own = pin(0, last - 1500)
        return texts(list(end_faults(attempt(own, end=end), stops[:count])))

    assert said(7, 7_000_000, 7_000_000) == []
    # Two rounds are enough, but not if it stays at the last position for more than twice the longest pause.
    assert said(7, 8_000_000, 16_000_000) == []
    assert said(7, 7_900_000, 16_000_000) == ["the pulses stop after 7.9 s; the motion must repeat endlessly"]
    assert said(6, 6_000_000, 6_000_000) == ["only 1 complete round in 6 s instead of 2 or more"]
    assert said(4, 4_000_000, 12_000_000) == ["only 1 complete round in 12 s instead of 2 or more"]
    assert said(4, 3_900_000, 12_000_000) == [
        "only 1 complete round in 12 s instead of 2 or more: the pulses stop after 3.9 s; "
        "the motion must repeat endlessly"
    ]
    assert said(3, 3_000_000, 3_000_000) == ["no complete round in 3 s instead of 2 or more"]
    assert said(0, 3_000_000, 3_000_000) == ["no complete round in 3 s instead of 2 or more"]
    for length, stuck in ((8_000_000, False), (8_000_001, True)):
        long = [stops[0], visit(1_000_000, 1_000_000 + length, [1])]
        end = 1_000_000 + length
        (text,) = texts(list(end_faults(attempt(pin(0, end - 9), end=end), long)))
        assert ("after 1.0 s nothing moves; the motion must repeat endlessly" in text) == stuck


# Causes


def test_the_watchdog_is_the_one_cause() -> None:
    seen = watched(end=2_500_000)
    assert cause(LAB, seen, ChipFacts()) is None
    once = cause(LAB, seen, ChipFacts(watchdog_resets=1))
    assert once is not None
    assert once.startswith("the watchdog resets the chip once in 2.5 s: turn it off (")
    assert once.endswith("_WDT_OFF), or clear it in time")
    often = cause(LAB, seen, ChipFacts(watchdog_resets=2, configured=False))
    assert often is not None
    assert often.startswith(
        "the watchdog resets the chip 2 times in 2.5 s: the program has no configuration word, so the "
        "watchdog is on; turn it off"
    )
    racing = watched({RB0: pin(1), RB1: pin(1, 2, 3)}, end=1000, too_fast=True)
    assert (
        cause(LAB, racing, ChipFacts()) == "RB1 changes 6 times in 0.001 s: these are not pulses for a servo"
    )


@pytest.mark.parametrize(
    ("pins", "facts", "text"),
    [
        (
            {},
            ChipFacts(),
            "the pin is an output, but never goes high and low again; "
            "nor does another: the program hangs before that, or writes to inputs",
        ),
        ({12: pin(1)}, ChipFacts(sleeping=True), "the pulses are on RB7"),
        ({3: pin(1), 12: pin(1)}, ChipFacts(), "the pulses are on RA3 and RB7"),
        (
            {4: pin(1)},
            ChipFacts(),
            "the pulses are on RA4, which is an open drain and needs a pull-up resistor",
        ),
    ],
)
def test_a_servo_without_pulses_is_told_the_likely_cause(
    pins: dict[int, PinPulses], facts: ChipFacts, text: str
) -> None:
    lab = replace(LAB, servos=(replace(SERVO, pins=("RB0", "RB1")),))
    head = f"there are no pulses for the servo '{SERVO.servo.name}' on RB0"
    assert list(silent_reasons(lab, watched(pins), facts)) == [f"{head}: {text}"]
    assert list(silent_reasons(lab, watched({**pins, RB1: pin(1)}), facts)) == []


def test_a_pin_that_stays_high_and_a_second_servo_are_named() -> None:
    lab = replace(LAB, servos=(replace(SERVO, pins=("RB0", "RB1")),))
    stuck = watched(high_since={RB1: 12_340})
    assert list(silent_reasons(lab, stuck, ChipFacts())) == [
        "RB1 goes high 12.34 ms after the start and stays high: a pulse must end"
    ]
    two = replace(LAB, servos=(replace(SERVO, pins=("RB0",)), replace(SERVO, pins=("RA1",))))
    (text,) = silent_reasons(two, watched({RB0: pin(1)}), ChipFacts(inputs=frozenset({1})))
    assert text.endswith("on RA1: the pin is still an input; its bit in TRISA (bank 1) must be 0")
    (other,) = silent_reasons(two, watched({RB0: pin(1)}), ChipFacts())
    assert other.endswith("the pin is an output, but never goes high and low again")


def test_a_source_for_another_crystal_is_said() -> None:
    assert clock_words(LAB, ChipFacts()) is None
    assert clock_words(LAB, ChipFacts(written_for_hz=LAB.clock.hz)) is None
    assert clock_words(replace(LAB, clock=MHZ4), ChipFacts(written_for_hz=2_500_000)) == (
        "the program is written for a crystal of 2.5 MHz, but the board has 4 MHz: all its times are wrong"
    )


# Grades and points


def test_a_program_that_is_wrong_for_its_clock_has_one_fault() -> None:
    lab = replace(LAB8, clock=MHZ4)
    own = pin(*range(1000, 5_000_000, 20_000))
    seen = watched({PINS.index(SERVO.pins[0]): own}, end=5_000_000)
    found = judge(lab, seen, ChipFacts())
    assert found.faults
    wrong = judge(lab, seen, ChipFacts(written_for_hz=8_000_000))
    (fault,) = wrong.faults
    assert fault.text.startswith("the program is written for a crystal of 8 MHz")
    assert set(fault.checks) == {check for each in found.faults for check in each.checks}
    assert wrong.pins == ((SERVO.servo.name, SERVO.pins[0]),)
    assert (wrong.watched_s, wrong.repeats, wrong.passed) == (5.0, False, False)


def test_points_are_given_for_each_check_that_passes() -> None:
    lab = replace(LAB, points_passed=2.0, points=((Check.RUNS, 1.0), (Check.ORDER, 0.5)))
    right = outcomes(lab, Grade("lab8", ()))
    assert [(each.key, each.points) for each in right if each.max_points] == [
        ("runs", 1.0),
        ("order", 0.5),
        ("passed", 2.0),
    ]
    assert [each.key for each in right] == [*Check, "passed"]
    assert (total(right), max_total(right)) == (3.5, 3.5)
    faults = (Fault((Check.ORDER, Check.PAUSES), "wrong order"), Fault((Check.ORDER,), "very wrong:\nso"))
    some = {each.key: each for each in outcomes(lab, Grade("lab8", faults, (Check.TRAVEL,)))}
    assert (some["order"].state, some["order"].text) == (CheckState.FAILED, "wrong order\nvery wrong:\nso")
    assert (some["travel"].state, some["travel"].text) == (
        CheckState.NOT_CHECKED,
        "could not be checked: wrong order; very wrong: so",
    )
    assert (some["passed"].state, some["passed"].text) == (
        CheckState.FAILED,
        "only for a program without any fault",
    )
    assert (total(list(some.values())), max_total(list(some.values()))) == (1.0, 3.5)
    assert right[-1].text == ""
    plain = outcomes(replace(LAB, points_passed=0.0), Grade("lab8", ()))
    assert [each.key for each in plain] == [*Check]
    still = Solution("", (position("A", 25, 35), position("B", 85, 95)))
    assert "pauses" not in [
        each.key for each in outcomes(replace(LAB, solutions=(still,)), Grade("lab8", ()))
    ]


def test_points_and_reasons_are_written_short() -> None:
    assert [number(each) for each in (2.0, 0.5, 0.1 + 0.2)] == ["2", "0.5", "0.3"]
    assert headline("one\ntwo\nthree") == "one"
    assert headline("one:\ntwo\nthree") == "one: two"
    assert headline("one:") == "one:"


def test_a_right_program_is_measured_at_each_position_and_remarked() -> None:
    """100 s of 2, 5 and 3 s: ten rounds, the last of which the watch cuts at its third position."""
    found = grade(RIGHT, chip=ChipFacts(configured=False))
    assert found.passed and len(found.rounds) == 10
    assert [(row.name, row.visits, row.widths_us, row.pause_s) for row in found.rows] == [
        ("30°", 10, ((1167.0, 1167.0),), 2.0),
        ("90°", 10, ((1500.0, 1500.0),), 5.0),
        ("120°", 10, ((1667.0, 1667.0),), 3.0),
    ]
    for row, seconds in zip(found.rows, (2.0, 5.0, 3.0), strict=True):
        assert row.periods_ms == pytest.approx((20.0, 20.0))
        assert row.stays_s == pytest.approx((seconds, seconds))
        assert row.silent_s == (0.0, 0.0)
        assert row.angles_deg[0] == pytest.approx((float(row.name[:-1]),) * 2, abs=0.1)
    assert [remark.code for remark in found.remarks] == ["no-configuration"]
    assert grade(RIGHT).remarks == ()
    (other,) = grade(RIGHT, pin=RB1).remarks
    assert other.message == "the servo 'arm' is on RB1, not on the lab's RB0: wire it there"
    assert found.seen == "30° → 90° → 120° → 30° → 90° → 120° → …"
    shown = found.to_json()
    assert (shown["lab"], shown["passed"], shown["reasons"], shown["pins"]) == (
        "lab8-exercise",
        True,
        [],
        {"arm": "RB0"},
    )
    assert (shown["seen"], shown["watched_s"], shown["repeats"]) == (found.seen, 100.0, False)
    assert [row["visits"] for row in shown["positions"]] == [10, 10, 10]  # type: ignore[attr-defined]


def test_of_several_solutions_the_one_that_passes_counts() -> None:
    right = LAB8.solutions[0]
    wrong = Solution("backwards", (right.positions[1], right.positions[0], right.positions[2]))
    lab = replace(LAB8, solutions=(wrong, replace(right, name="forwards")))
    rises, widths = pulses(RIGHT)
    own = PinPulses(np.array(rises), np.add(rises, widths))
    found = judge(lab, watched({RB0: own}, end=100_000_000), ChipFacts())
    assert found.passed
    assert [remark.message for remark in found.remarks] == ["graded as: forwards"]
