"""The judge on pulses written down by hand, one fault at a time, without a compiler or a chip."""

from collections.abc import Sequence

import numpy as np
import pytest

from servogen.edges import PINS, EdgeTrace, edge_chunk
from servogen.grade import ChipFacts, Grade, judge, load_lab
from servogen.grade.lab import Check
from servogen.grade.watch import MAX_EDGES, watch
from servogen.units import Clock, Cycles

LAB = load_lab("lab8-exercise")
END = 100_000_000
RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")
W30, W90, W120 = 1167, 1500, 1667

Step = tuple[int, int, int, int]
"""Pulses, their width, their period, the pause behind them: in cycles of 1 µs."""


def pulses(steps: Sequence[Step], end: int = END, again: bool = True) -> tuple[list[int], list[int]]:
    rises, widths, now = [], [], 1000
    while now < end:
        for count, width, period, pause in steps:
            for _ in range(count):
                if now + width < end:
                    rises.append(now)
                    widths.append(width)
                now += period
            now += pause
        if not again:
            break
    return rises, widths


def grade(steps: Sequence[Step], pin: int = RB0, again: bool = True, chip: ChipFacts | None = None) -> Grade:
    rises, widths = pulses(steps, again=again)
    cycle = np.column_stack((rises, np.add(rises, widths))).ravel()
    level = np.tile([1, 0], len(rises))
    chunk = edge_chunk(cycle, np.full(len(cycle), pin), level)
    return judge(LAB, watch(EdgeTrace(Clock(4_000_000), (chunk,), Cycles(END))), chip or ChipFacts())


RIGHT: tuple[Step, ...] = ((100, W30, 20_000, 0), (250, W90, 20_000, 0), (150, W120, 20_000, 0))


def changed(index: int, step: Step) -> list[Step]:
    steps = list(RIGHT)
    steps[index] = step
    return steps


def test_pulses_through_the_pauses_are_right() -> None:
    assert grade(RIGHT).passed


def test_pauses_without_pulses_are_right() -> None:
    assert grade(
        [(50, W30, 20_000, 2_000_000), (50, W90, 20_000, 5_000_000), (50, W120, 20_000, 3_000_000)]
    ).passed


def test_a_round_may_begin_anywhere() -> None:
    assert grade([RIGHT[1], RIGHT[2], RIGHT[0]]).passed


@pytest.mark.parametrize("percent", [-4.9, 4.9])
def test_a_pause_within_the_tolerance_is_right(percent: float) -> None:
    frames = round(250 * (1 + percent / 100))
    assert grade(changed(1, (frames, W90, 20_000, 0))).passed


@pytest.mark.parametrize("frames", [235, 265])
def test_a_pause_outside_the_tolerance_is_told_with_its_length(frames: int) -> None:
    (reason,) = grade(changed(1, (frames, W90, 20_000, 0))).reasons
    assert reason == f"it stays at 90°, with pulses, for {frames * 0.02:.2f} s; the pause should be 5 s"


def test_one_wrong_pause_among_many_right_ones_is_found() -> None:
    steps = [*RIGHT * 5, *changed(1, (150, W90, 20_000, 0)), *RIGHT * 5]
    assert "for 3.00 s; the pause should be 5 s" in grade(steps).reasons[0]


@pytest.mark.parametrize(("width", "right"), [(1145, True), (1188, True), (1142, False), (1192, False)])
def test_an_angle_is_right_within_four_degrees(width: int, right: bool) -> None:
    """Four degrees of the S3001 are 4 × 1000 / 180 = 22.2 µs."""
    assert grade(changed(0, (100, width, 20_000, 0))).passed is right


def test_one_strange_pulse_is_found() -> None:
    steps = [*RIGHT * 3, (100, W30, 20_000, 0), (1, 1900, 20_000, 0), *RIGHT[1:], *RIGHT * 3]
    found = grade(steps)
    assert not found.passed
    assert any("1900 µs, which is 162.0°" in reason for reason in found.reasons)


def test_a_missed_position_is_an_order_that_is_wrong() -> None:
    assert grade(RIGHT[:2]).reasons[0].startswith("the order is 30° → 90° → 30°")


def test_and_back_may_go_through_a_position_again() -> None:
    """Back from 120° through 90°, which the task allows and says no pause of; but not 30° again."""
    there_and_back = [*RIGHT, (40, W90, 20_000, 0)]
    assert grade(there_and_back).passed
    assert grade([*RIGHT, (250, W90, 20_000, 0)]).passed
    assert not grade([*RIGHT, (40, W30, 20_000, 0), (40, W90, 20_000, 0)]).passed


def ramp(start: int, end: int, frames: int) -> list[Step]:
    """Widths between two positions, a frame each."""
    return [(1, start + (end - start) * (step + 1) // (frames + 1), 20_000, 0) for step in range(frames)]


def test_a_move_that_lasts_too_long_is_not_a_wrong_order() -> None:
    """From 30° to 90° in 100 frames, of which the first and the last are within the 4° of a position."""
    steps = [RIGHT[0], *ramp(W30, W90, 100), *RIGHT[1:]]
    found = grade(steps)
    failed = {check for fault in found.faults for check in fault.checks}
    assert Check.ORDER not in failed and Check.POSITIONS not in failed
    assert any("the move from 30° to 90° lasts 1.7" in reason for reason in found.reasons)
    assert grade([RIGHT[0], *ramp(W30, W90, 40), *RIGHT[1:]]).passed


def test_a_position_that_is_passed_too_fast_is_not_a_wrong_order() -> None:
    """90° for 10 frames in a ramp from 30° to 120°: its pause is wrong, not the order."""
    steps = [RIGHT[0], *ramp(W30, W90, 20), (10, W90, 20_000, 0), *ramp(W90, W120, 20), RIGHT[2]]
    found = grade(steps)
    failed = {check for fault in found.faults for check in fault.checks}
    assert Check.ORDER not in failed and Check.PAUSES in failed
    assert any("at 90°, with pulses, for 0." in reason for reason in found.reasons)


def test_a_wandering_period_is_told() -> None:
    steps = [(10, W30, 19_000 + 100 * step, 0) for step in range(10)] + list(RIGHT[1:])
    (reason,) = grade(steps).reasons
    assert reason.startswith("the period on RB0 drifts at 30°: 19.000 to 19.900 ms")


def test_frames_of_two_lengths_are_told() -> None:
    steps = [(1, W30, 19_000 + 900 * (step % 2), 0) for step in range(100)] + list(RIGHT[1:])
    (reason,) = grade(steps).reasons
    assert reason.startswith("the period on RB0 varies at 30°")


def test_a_program_that_ends_is_told_when() -> None:
    (reason,) = grade(RIGHT * 2, again=False).reasons
    assert "only 1 complete round in 100 s" in reason
    assert "the pulses stop after 20.0 s" in reason


@pytest.mark.parametrize("rounds", [4, 6, 8])
def test_a_program_that_ends_after_enough_rounds_does_not_repeat_endlessly_either(rounds: int) -> None:
    """Three rounds of 10 s are enough, of which the third ends with the fourth; 100 s were watched."""
    (fault,) = grade(RIGHT * rounds, again=False).faults
    assert fault.checks == (Check.REPETITION,)
    assert fault.text == f"the pulses stop after {rounds * 10:.1f} s; the motion must repeat endlessly"
    held = [*RIGHT * (rounds - 1), *RIGHT[:2], (5000, W120, 20_000, 0)]
    (reason,) = grade(held, again=False).reasons
    assert reason == f"after {rounds * 10 - 3:.1f} s nothing moves; the motion must repeat endlessly"


def test_a_round_begins_at_the_first_position_of_the_solution() -> None:
    """At 1 ms and every 10 s after that; where the program begins at another position, later."""
    assert grade(RIGHT).rounds == tuple(range(1000, END, 10_000_000))
    assert grade([*RIGHT[1:], RIGHT[0]]).rounds == tuple(range(8_001_000, END, 10_000_000))


def test_pulses_on_a_pin_that_is_not_allowed_are_told() -> None:
    (reason,) = grade(RIGHT, pin=PINS.index("RA4")).reasons
    assert "the pulses are on RA4, which is an open drain" in reason


def graded_on(pins: dict[str, Sequence[Step]]) -> Grade:
    """Return the grade of a program with these pulses on pins."""
    edges = []
    for name, steps in pins.items():
        for rise, width in zip(*pulses(steps), strict=True):
            edges += [(rise, PINS.index(name), 1), (rise + width, PINS.index(name), 0)]
    chunk = edge_chunk(*zip(*sorted(edges), strict=True))
    return judge(LAB, watch(EdgeTrace(Clock(4_000_000), (chunk,), Cycles(END))), ChipFacts())


def test_a_program_is_judged_on_the_labs_pin_or_on_the_allowed_one_that_is_right() -> None:
    wrong = changed(1, (250, W120, 20_000, 0))
    assert not graded_on({"RB0": wrong, "RB1": RIGHT}).passed
    other = graded_on({"RB1": wrong, "RB2": RIGHT})
    assert other.passed and other.pins == (("arm", "RB2"),)
    assert [remark.message for remark in other.remarks] == [
        "the servo 'arm' is on RB2, not on the lab's RB0: wire it there",
        "there are also pulses on RB1, where no servo is connected",
    ]


def test_a_watchdog_reset_is_the_one_cause() -> None:
    (reason,) = grade(RIGHT[:1], chip=ChipFacts(watchdog_resets=7)).reasons
    assert reason.startswith("the watchdog resets the chip 7 times in 100 s: turn it off")


def test_a_pin_that_races_is_given_up_and_told() -> None:
    cycle = np.arange(MAX_EDGES + 10) * 10
    chunk = edge_chunk(cycle, np.full(len(cycle), RB0), 1 - np.arange(len(cycle)) % 2)
    watched = watch(EdgeTrace(Clock(4_000_000), (chunk,), Cycles(END)))
    assert watched.end < END
    (reason,) = judge(LAB, watched, ChipFacts()).reasons
    assert "these are not pulses for a servo" in reason


def test_a_pin_that_never_moves_is_told_the_likely_cause() -> None:
    nothing = watch(EdgeTrace(Clock(4_000_000), (), Cycles(END)))
    for chip, words in (
        (ChipFacts(inputs=frozenset({RB0})), "its bit in TRISB (bank 1) must be 0"),
        (ChipFacts(sleeping=True), "the chip is asleep"),
        (ChipFacts(lost=True), "it needs an endless loop"),
        (ChipFacts(stack_wraps=3), "deeper than the chip's 8 levels"),
        (ChipFacts(), "the program hangs before that"),
    ):
        (reason,) = judge(LAB, nothing, chip).reasons
        assert words in reason


# Two servos: the law of one servo holds for each

LEG = load_lab("lab9-exercise")
DOWN, UP, BACK, FRONT = 1500, 1250, 1250, 1500
"""Pulses of the lab's program: 30 µs more or less would be another position of none of its solutions."""
WALK = ((DOWN, BACK), (UP, BACK), (UP, FRONT), (DOWN, FRONT))
SECOND = 1_000_000
Pulse = tuple[int, int, int]
"""Its pin, rise and width."""


def frames(vertical: int, horizontal: int, count: int, but: Sequence[tuple[str, int]] = ()) -> list[Pulse]:
    """Return frames of 20 ms in which both servos get a pulse, `but` for the missing (pin, frame)."""
    return [
        (PINS.index(pin), number * 20_000 + at, width)
        for number in range(count)
        for pin, at, width in (("RB0", 0, vertical), ("RB1", 2500, horizontal))
        if (pin, number) not in but
    ]


def burst(pin: str, width: int, count: int = 20) -> list[Pulse]:
    return [(PINS.index(pin), number * 20_000, width) for number in range(count)]


def walk(rounds: int, positions: Sequence[Sequence[tuple[Sequence[Pulse], int]]]) -> Grade:
    """Return the grade of a program that gives these pulses, each with a pause behind, round after round."""
    edges, now = [], 1000
    for _ in range(rounds):
        for parts in positions:
            for part, pause in parts:
                for pin, rise, width in part:
                    edges += [(now + rise, pin, 1), (now + rise + width, pin, 0)]
                now += max(rise for _, rise, _ in part) // 20_000 * 20_000 + 20_000 + pause
    chunk = edge_chunk(*zip(*sorted(edges), strict=True))
    return judge(LEG, watch(EdgeTrace(Clock(4_000_000), (chunk,), Cycles(now))), ChipFacts())


def in_frames(but: Sequence[tuple[str, int]] = (), pause: int = 0) -> list[list[tuple[list[Pulse], int]]]:
    """Return the walk in frames; `but`: what is missing at its second position."""
    return [[(frames(*widths, 40, but if widths == WALK[1] else ()), pause)] for widths in WALK]


@pytest.mark.parametrize("pause", [0, SECOND])
@pytest.mark.parametrize("first", [0, 1])
def test_frames_with_a_pulse_of_each_servo_are_right_with_and_without_pauses(pause: int, first: int) -> None:
    """Whichever servo is the first in a frame, it may get its first pulse before the other one changes."""
    assert walk(4, in_frames(pause=pause)[first:] + in_frames(pause=pause)[:first]).passed
    slots = ((2500, 0), (0, 2500))[first]
    swapped = [
        [([(pin, rise + slots[pin - RB0] - (rise % 20_000), width) for pin, rise, width in part], pause)]
        for ((part, pause),) in in_frames(pause=pause)
    ]
    assert walk(4, swapped).passed


@pytest.mark.parametrize("pin", ["RB0", "RB1"])
def test_missing_pulses_of_one_of_two_servos_are_told_with_its_pin(pin: str) -> None:
    grade = walk(4, in_frames(but=[(pin, frame) for frame in (20, 21, 22)]))
    assert [fault.checks for fault in grade.faults] == [(Check.PERIOD,)]
    assert grade.reasons == (
        f"the pulses on {pin} for up and back stop, and go on 0.08 s later; a pause comes after the last one",
    )


def test_a_pause_in_which_no_servo_gets_pulses_is_told_of_each() -> None:
    grade = walk(4, [[(frames(*widths, 20), SECOND), (frames(*widths, 20), 0)] for widths in WALK])
    assert [reason.split(" for ")[0] for reason in grade.reasons] == [
        "the pulses on RB0",
        "the pulses on RB1",
    ]
    assert all("go on 1.02 s later" in reason for reason in grade.reasons)


@pytest.mark.parametrize("pause", [0, SECOND])
@pytest.mark.parametrize("between", [0, SECOND // 4])
def test_servos_that_get_their_pulses_in_turns_are_right(pause: int, between: int) -> None:
    """A servo that does not change gets its pulses again, before or after those of the one that does."""
    for order in ((0, 1), (1, 0)):
        turns = [
            [
                (burst(("RB0", "RB1")[index], widths[index]), gap)
                for index, gap in zip(order, (between, pause), strict=True)
            ]
            for widths in WALK
        ]
        assert walk(4, turns).reasons == ()


def test_servos_that_take_turns_may_do_so_more_than_once_at_a_position_but_not_pause_between() -> None:
    twice = [[(burst("RB0", v), 0), (burst("RB1", h), 0)] * 2 for v, h in WALK]
    assert walk(4, twice).passed
    paused = [[(burst("RB0", v), 0), (burst("RB1", h), SECOND)] * 2 for v, h in WALK]
    reasons = walk(4, paused).reasons
    assert [reason.split(" for ")[0] for reason in reasons] == ["the pulses on RB0", "the pulses on RB1"]
    assert all("go on 1.42 s later" in reason for reason in reasons)


def test_a_servo_that_alone_gets_pulses_at_a_position_gets_them_without_a_pause() -> None:
    moves = [("RB0", UP), ("RB1", FRONT), ("RB0", DOWN), ("RB1", BACK)]
    first = (frames(*WALK[0], 20), 0)
    assert walk(1, [[first], *([(burst(*move, count=40), SECOND)] for move in moves * 4)]).passed
    stopping = [[(burst(*move), SECOND // 10), (burst(*move), SECOND)] for move in moves]
    grade = walk(1, [[first], *stopping * 4])
    assert [reason.split(" stop")[0] for reason in grade.reasons] == [
        "the pulses on RB0 for down and front",
        "the pulses on RB1 for up and front",
    ]
