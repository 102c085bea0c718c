"""The checks at their limits, from both sides, and the words of every warning."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from servogen.errors import Diagnostic, InputError, Location
from servogen.plan_error import PlanError
from servogen.pulse import Frame
from servogen.pulse.lint import (
    check_calibration,
    check_measured,
    check_motion,
    check_period,
    check_periods,
    check_unknown,
)
from servogen.pulse.lint import check_widths as check
from servogen.pulse.quantise import NO_PULSE, channel_error, error_of_rows, largest, quantise
from servogen.pulse.slots import rises
from servogen.robot.servo import Servo, calibration, servo
from servogen.robot.servo_models import FactKeys, servo_model
from servogen.units import Clock, Cycles

S3001 = servo("arm", "RB0", servo_model("futaba-s3001"))
"""0 to 180° in 1000 to 2000 µs, 1.8 rad/s."""
TINY_S = servo("leg", "RB1", servo_model("mpx-tiny-s"))
"""0 to 180° in 1250 to 1750 µs."""
CLOCK = Clock(4_000_000)
PLACE = Location("job.toml", 7)


def words(found: tuple[Diagnostic, ...]) -> list[str]:
    return [f"{each.severity} {each.code}: {each.message}" for each in found]


def test_periods_are_recommended_from_18_to_20_ms() -> None:
    for period in (18_000.0, 20_000.0):
        assert check_periods([period]) == ()
    outside = "a period of {} is outside 18 to 20 ms"
    assert words(check_periods([17_999.0])) == ["warning period-range: " + outside.format("17.999 ms")]
    assert words(check_periods([20_001.0])) == ["warning period-range: " + outside.format("20.001 ms")]
    assert words(check_periods([9_999.0], "RB3")) == [
        "warning period-range: RB3: " + outside.format("9999 µs")
    ]
    assert words(check_periods([10_000.0])) == ["warning period-range: " + outside.format("10 ms")]
    assert words(check_periods([19_000.0, 18_500.0, 19_500.0])) == [
        "warning period-varies: frames differ by 1000 µs: periods of 18.5 ms to 19.5 ms"
    ]
    assert check_periods([]) == ()
    assert [each.location for each in check_periods([1.0, 2.0], place=PLACE)] == [PLACE] * 3


def test_a_period_that_is_not_whole_cycles() -> None:
    """At 32768 Hz a cycle is 4/32768 s: 20 ms are 163.84 cycles, and 164 of them 20.0195 ms."""
    (found,) = check_period(Clock(32_768).round_us(20_000), PLACE)
    assert words((found,)) == [
        "warning period-rounded: a period of 20 ms is not whole cycles: 164 cycles are 20.0195 ms"
    ]
    assert found.location == PLACE
    assert [each.code for each in check_period(Clock(32_768).round_us(30_000))] == [
        "period-rounded", "period-range"
    ]  # fmt: skip


def test_a_width_may_leave_the_range_by_2_microseconds() -> None:
    assert check(S3001, [998.0, 2002.0]) == ()
    assert words(check(S3001, [2002.5, 997.5, 997.5])) == [
        "warning width-range: arm: a pulse of 997.5 µs is outside the servo's 1000 µs to 2000 µs",
        "warning angle-range: arm: 997.5 µs would be 0°, outside its travel of 0° to 180°",
        "warning width-range: arm: a pulse of 2002.5 µs is outside the servo's 1000 µs to 2000 µs",
        "warning angle-range: arm: 2002.5 µs would be 180°, outside its travel of 0° to 180°",
    ]
    assert check(S3001, [1000.0, 2000.0], tolerance_us=0.0) == ()
    assert len(check(S3001, [999.9], tolerance_us=0.0)) == 2
    # 500 µs are 750 below the 1250 of 0°, and 500 µs are 180°.
    assert "500 µs would be -270°" in words(check(TINY_S, [500.0]))[1]


def test_a_servo_that_is_not_known_accepts_1_to_2_ms() -> None:
    assert check_unknown("RB4", [998.0, 2002.0]) == ()
    assert words(check_unknown("RB4", [2003.0, 997.0, 997.0])) == [
        "warning width-range: RB4: a pulse of 997 µs is outside 1 to 2 ms",
        "warning width-range: RB4: a pulse of 2003 µs is outside 1 to 2 ms",
    ]


@pytest.mark.parametrize(
    ("shortest", "longest", "warned"),
    [(900.0, 2100.0, False), (899.0, 2100.0, True), (900.0, 2101.0, True), (1000.0, 2000.0, False)],
)
def test_a_calibration_may_differ_by_a_tenth_of_the_range(
    shortest: float, longest: float, warned: bool
) -> None:
    own = servo(
        "a", "RB0", servo_model("futaba-s3001"), points=calibration(((0.0, shortest), (math.pi, longest)))
    )
    found = words(check_calibration(own))
    assert found == (
        [
            f"warning width-range: a: pulses of {shortest:g} µs to {longest:g} µs go beyond a Futaba S3001's "
            "1000 µs to 2000 µs"
        ]
        if warned
        else []
    )


def at_speed(degrees_a_second: float) -> Servo:
    return servo("x", "RB0", servo_model("futaba-s3001", overrides=FactKeys(speed_deg_s=degrees_a_second)))


def motion(angles: list[float], frames: list[int], loop_start: int = 0, speed: float = 100.0) -> list[str]:
    """Return the warnings about positions in degrees, each for some frames of 20 ms: 2° in a frame."""
    steps = np.radians(np.repeat(angles, frames))
    return words(check_motion(at_speed(speed), steps, loop_start, 0.02))


FEW = (
    "warning frames-few: x has to leave a position {} before it can reach it: "
    "the travel takes {} frames at 100°/s"
)


def test_a_position_is_held_until_the_servo_reaches_it() -> None:
    """20° take 10 frames."""
    assert motion([0, 20], [10, 10]) == []
    assert motion([0, 20], [10, 9]) == [FEW.format("1 frame", 10)]
    assert motion([0, 20], [10, 8]) == [FEW.format("2 frames", 10)]
    assert motion([0, 20], [9, 10]) == [FEW.format("1 frame", 10)], "the way back, as the loop begins again"
    assert motion([0, 20], [9, 10], loop_start=19) == []
    assert motion([0, 20, 40], [20, 8, 20], loop_start=48) == [FEW.format("2 frames", 10)]
    # It has come to 16° only: 24° are missing, of which 11 frames make 22°.
    assert motion([0, 20, 40], [20, 8, 11], loop_start=39) == [FEW.format("2 frames", 10)]
    assert motion([0, 20, 40], [20, 8, 9], loop_start=37) == [FEW.format("3 frames", 12)]
    assert motion([], []) == []


def test_a_ramp_is_as_steep_as_the_servo_turns() -> None:
    def ramp(step: float) -> list[str]:
        return motion([step * number for number in range(20)], [1] * 20, loop_start=20)

    fast = "warning too-fast: x would have to turn at {}°/s: its maximum is 100°/s"
    assert ramp(2.0) == []
    assert ramp(2.02) == [fast.format(101)]
    assert ramp(-4.0) == [fast.format(200)]
    # After one frame at 10° it has come to 2°, and needs 9 frames for the other 18°.
    both = motion([0, 10, 20], [1, 1, 2], loop_start=4)
    assert both == [fast.format(500), FEW.format("7 frames", 9)]


def test_measured_pulses_are_checked_by_the_median_period() -> None:
    """1000 and 1100 µs are 18° apart: at 1.8 rad/s 8.7 frames of 20 ms."""

    def measured(frames: int, period: float) -> list[str]:
        found = check_measured(S3001, [1000.0] * 20 + [1100.0] * frames, [period] * (19 + frames))
        return [each.code for each in found]

    assert measured(9, 20_000.0) == []
    assert measured(8, 20_000.0) == ["frames-few"]
    assert measured(9, 19_000.0) == ["frames-few"]
    assert measured(8, 0.0) == ["period-range"]
    assert [each.code for each in check_measured(S3001, [500.0], [])] == ["width-range", "angle-range"]


# -- slots ---------------------------------------------------------------------------------------------


def frame(**options: object) -> Frame:
    return Frame(CLOCK.round_us(20_000), **options)  # type: ignore[arg-type]


def test_a_slot_is_the_longest_pulse_and_the_gap() -> None:
    """2000 µs and 1750 µs, with gaps of 250 µs, at least 64 cycles."""
    pair = [S3001, TINY_S]
    assert rises([*pair, S3001], frame(), CLOCK) == (0, 2250, 4250)
    assert rises([*pair, S3001], frame(gap_us=Fraction(100)), CLOCK) == (0, 2100, 3950)
    assert rises(pair, frame(gap_us=Fraction(0)), CLOCK) == (0, 2064)
    assert rises(pair, frame(gap_us=Fraction(63)), CLOCK) == (0, 2064)
    assert rises(pair, frame(gap_us=Fraction(65)), CLOCK) == (0, 2065)
    assert rises([TINY_S, S3001, TINY_S], frame(per_slot=2), CLOCK) == (0, 0, 2250)
    assert rises([*pair, *pair, TINY_S], frame(per_slot=2), CLOCK) == (0, 0, 2250, 2250, 4500)
    assert rises([*pair, S3001], frame(slot_us=Fraction(3000)), CLOCK) == (0, 3000, 6000)
    assert rises([S3001] * 8, Frame(CLOCK.round_us(18_000)), CLOCK)[-1] == 7 * 2250
    assert rises([], frame(), CLOCK) == ()


def refused(*servos: Servo, clock: Clock = CLOCK, **options: object) -> tuple[str, str | None]:
    with pytest.raises(InputError) as caught:
        rises(servos, Frame(clock.round_us(20_000), place=PLACE, **options), clock)  # type: ignore[arg-type]
    assert (caught.value.code, caught.value.location) == ("frame-too-short", PLACE)
    return caught.value.message, caught.value.hint


def test_slots_that_do_not_fit_are_refused_with_what_they_take() -> None:
    hint = "lengthen period_us, shorten gap_us, raise per_slot, or narrow the servos' limits"
    assert refused(*[S3001] * 9) == (
        "the pulses do not fit a frame: 9, 1 at a time, take 20250 µs, the frame has 20000 µs", hint
    )  # fmt: skip
    assert refused(*[S3001] * 20, per_slot=2)[0].startswith(
        "the pulses do not fit a frame: 20, 2 at a time, take 22500 µs"
    )
    assert refused(S3001, slot_us=Fraction(2063)) == (
        "a slot of 2063 µs is too short for arm", "its longest pulse and the minimum gap take 2064 µs"
    )  # fmt: skip
    assert rises([S3001], frame(slot_us=Fraction(2064)), CLOCK) == (0,)
    assert refused(S3001, S3001, S3001, per_slot=3, max_together=2) == (
        "per_slot = 3 servos start together, max_together allows 2", "write per_slot = 2"
    )  # fmt: skip
    assert rises([S3001, S3001], frame(per_slot=2, max_together=2), CLOCK) == (0, 0)
    # 1 MHz: 64 cycles are 256 µs, more than the gap of 250 µs: the clock is what is too slow.
    slow = refused(*[S3001] * 9, clock=Clock(1_000_000))
    assert slow[0].endswith("; at 1000000 Hz the 64 cycles from one edge to the next take 256 µs")
    assert slow[1] == "use a faster clock"
    assert refused(*[S3001] * 9, clock=Clock(1_000_000), gap_us=Fraction(256))[1] == hint


# -- rounding ------------------------------------------------------------------------------------------


def test_equal_and_nearly_equal_angles_share_a_row() -> None:
    angles = np.radians([0.0, 0.0, 90.0, 180.0, 90.0, math.nan, 1e-12])
    cycles, rows = quantise(S3001, angles, CLOCK)
    assert cycles.tolist() == [1000, 1000, 1500, 2000, 1500, NO_PULSE, 1000]
    assert [(row.cycles, row.frames, row.held) for row in rows] == [
        (1000, 3, True), (1500, 2, False), (2000, 1, False)
    ]  # fmt: skip
    assert rows[0].to_json() == {
        "servo": "arm", "requested_us": 1000.0, "cycles": 1000, "achieved_us": 1000.0, "error_us": 0.0,
        "frames": 3,
    }  # fmt: skip
    assert all(row.which == "" for row in rows)


def test_a_requested_width_is_rounded_to_a_ten_thousandth_and_then_to_cycles() -> None:
    """1166.6667 µs at 10 MHz, of 0.4 µs cycles: 2916.67, so 2917 cycles, 1166.8 µs."""
    _, (row,) = quantise(S3001, np.radians([30.0]), Clock(10_000_000))
    assert (row.requested_us, row.cycles) == (Fraction(11_666_667, 10_000), 2917)
    assert (row.achieved_us, row.error_us) == (
        Fraction(11668, 10),
        Fraction(11668, 10) - Fraction(11_666_667, 10_000),
    )


def test_a_pulse_of_less_than_half_a_cycle_is_refused() -> None:
    """At 2000 Hz a cycle is 2000 µs: 1000 µs are rounded up to one, at 1999 Hz they are less than half."""
    assert quantise(S3001, np.radians([0.0]), Clock(2000))[0].tolist() == [1]
    with pytest.raises(InputError) as caught:
        quantise(S3001, np.radians([0.0]), Clock(1999))
    assert caught.value.message == "arm: a pulse of 1000 µs is shorter than half an instruction cycle"
    assert caught.value.hint == "a cycle is 2001 µs at 1999 Hz"


def test_the_error_of_a_channel_is_its_largest_in_width_and_angle() -> None:
    """1 µs of the S3001 is 0.18°."""
    error = channel_error(
        S3001, np.radians([0.0, 90.0]), np.array([1000.0, 1500.0]), np.array([1001.0, 1498.0])
    )
    assert (error.width_us, error.speed_deg_s) == (2.0, None)
    assert error.angle_deg == pytest.approx(0.36)
    nothing = np.array([])
    assert channel_error(S3001, nothing, nothing, nothing) == PlanError(0.0)
    _, rows = quantise(S3001, np.radians([30.0, 60.0, 0.0]), CLOCK)
    of_rows = error_of_rows(S3001, rows)
    assert of_rows.width_us == pytest.approx(1 / 3, abs=1e-4)  # 1166.67 and 1333.33 µs
    assert of_rows.angle_deg == pytest.approx(0.06, abs=1e-4)


def test_the_largest_of_several_errors_is_rounded_for_files() -> None:
    errors = [
        PlanError(0.12345, angle_deg=2.0),
        PlanError(1.0004, speed_deg_s=3.00049),
        PlanError(0.5, angle_deg=0.1),
    ]
    assert largest(errors) == PlanError(1.0, angle_deg=2.0, speed_deg_s=3.0)
    assert largest([]) == PlanError(0.0)
    assert largest([PlanError(0.25)]) == PlanError(0.25)


def test_the_gap_is_in_cycles() -> None:
    assert rises([S3001, S3001], Frame(Clock(20_000_000).round_us(20_000)), Clock(20_000_000)) == (
        Cycles(0), Cycles(11_250)
    )  # fmt: skip
