"""The checks warn of what a servo cannot do, planned or measured."""

import math

import numpy as np
import pytest

from servogen.errors import Diagnostic
from servogen.pulse.lint import check_calibration, check_measured, check_motion, check_period, check_periods
from servogen.pulse.lint import check_widths as check
from servogen.robot.servo import calibration, servo
from servogen.robot.servo_models import FactKeys, servo_model
from servogen.units import Clock

S3001 = servo("arm", "RB0", servo_model("futaba-s3001"))
TINY_S = servo("leg", "RB0", servo_model("mpx-tiny-s"))
FRAME_S = 0.02


def codes(found: tuple[Diagnostic, ...]) -> list[str]:
    return [each.code for each in found]


@pytest.mark.parametrize("period_us", [18_000, 19_000, 20_000])
def test_the_recommended_periods_pass(period_us: int) -> None:
    assert check_period(Clock(4_000_000).round_us(period_us)) == ()


@pytest.mark.parametrize("period_us", [17_999, 20_001, 43_000])
def test_other_periods_warn(period_us: int) -> None:
    assert codes(check_period(Clock(4_000_000).round_us(period_us))) == ["period-range"]


def test_a_period_that_is_not_whole_cycles_says_what_it_became() -> None:
    (found,) = check_period(Clock(32_768).round_us(20_000))
    assert found.code == "period-rounded"
    assert "164 cycles" in found.message


def test_the_150_microseconds_of_lab_9_are_named() -> None:
    found = check_periods([42_750.0, 42_750.0, 42_900.0], "RB0")
    assert codes(found) == ["period-varies", "period-range", "period-range"]
    assert "RB0: frames differ by 150 µs" in found[0].message


def test_the_500_microsecond_pulse_of_lab_9_is_named_with_both_its_faults() -> None:
    found = check(TINY_S, [500.0, 1500.0])
    assert codes(found) == ["width-range", "angle-range"]
    assert "500 µs is outside the servo's 1250 µs to 1750 µs" in found[0].message
    assert "-270°" in found[1].message


def test_a_microsecond_beyond_the_range_is_not_worth_a_word() -> None:
    assert check(S3001, [999.0, 2001.0]) == ()
    assert codes(check(S3001, [2003.0])) == ["width-range", "angle-range"]


def test_the_printed_lab_8_is_within_what_the_servo_can_do() -> None:
    widths = [1000.0] * 100 + [2000.0] * 100
    assert check_measured(S3001, widths, [19_000.0] * 100 + [20_000.0] * 100)[1:] == ()


def test_measured_pulses_have_all_checks() -> None:
    found = check_measured(TINY_S, [1500.0] * 20 + [500.0] * 20, [42_750.0] * 19 + [42_900.0] * 19)
    assert codes(found)[:2] == ["width-range", "angle-range"]
    assert "period-varies" in codes(found)


def test_a_channel_without_pulses_has_nothing_to_warn_of() -> None:
    assert check_measured(S3001, [], []) == ()


def steps(*positions: tuple[float, int]) -> np.ndarray:
    return np.radians(np.repeat([degrees for degrees, _ in positions], [frames for _, frames in positions]))


def test_180_degrees_of_the_s3001_take_88_frames_of_20_ms() -> None:
    # pi / 1.8 rad/s = 1.745 s = 87.3 frames
    assert check_motion(S3001, steps((0.0, 88), (180.0, 88)), 0, FRAME_S) == ()
    (found,) = check_motion(S3001, steps((0.0, 88), (180.0, 87)), 0, FRAME_S)
    assert found.code == "frames-few"
    assert "1 frame before" in found.message
    assert "takes 88 frames" in found.message


def test_the_travel_back_at_the_end_of_the_loop_is_looked_at() -> None:
    assert codes(check_motion(S3001, steps((0.0, 10), (180.0, 88)), 0, FRAME_S)) == ["frames-few"]


def test_a_slow_ramp_passes_and_a_fast_one_warns() -> None:
    # 1.8 rad/s is 2.06 degrees a frame
    slow = np.radians(np.concatenate((np.arange(0, 90, 2.0), np.arange(90, 0, -2.0))))
    assert check_motion(S3001, slow, 0, FRAME_S) == ()
    fast = np.radians(np.concatenate((np.arange(0, 90, 3.0), np.arange(90, 0, -3.0))))
    (found,) = check_motion(S3001, fast, 0, FRAME_S)
    assert found.code == "too-fast"
    assert "150°/s" in found.message
    assert "103°/s" in found.message


def test_frames_without_pulses_give_a_servo_no_time() -> None:
    angles = steps((0.0, 88), (180.0, 44))
    released = np.concatenate((angles, np.full(200, math.nan)))
    assert codes(check_motion(S3001, released, 0, FRAME_S)) == ["frames-few"]


def test_a_model_without_a_stated_speed_is_not_judged() -> None:
    own = servo("x", "RB0", servo_model("mpx-tiny-s", overrides=FactKeys(speed_deg_s=1.0)))
    assert codes(check_motion(own, steps((0.0, 2), (90.0, 2)), 0, FRAME_S)) == ["frames-few"]


def test_a_calibration_far_from_the_data_sheet_warns() -> None:
    model = servo_model("futaba-s3001")
    near = calibration(((0.0, 950.0), (math.pi, 2050.0)))
    far = calibration(((0.0, 500.0), (math.pi, 2500.0)))
    assert check_calibration(servo("a", "RB0", model, points=near)) == ()
    assert codes(check_calibration(servo("a", "RB0", model, points=far))) == ["width-range"]
