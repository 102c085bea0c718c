"""What a motion demands of a servo: ramps, steps and the frames between, of angles made by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.report import plan_facts
from servogen.report.plan_facts import ServoFacts, servo_facts

NAN = math.nan


def facts(
    angles: list[float], loop_start: int = 0, speed: float | None = 50.0, continuous: bool = False
) -> ServoFacts:
    """At 0.02 s a frame a servo of 50 rad/s reaches 1 rad."""
    servo: Any = SimpleNamespace(model=SimpleNamespace(speed=speed, continuous=continuous))
    return plan_facts._of_servo(servo, np.array(angles), loop_start, 0.02)


def test_the_steepest_ramp_and_the_frame_that_it_leads_to() -> None:
    """Changes of 1, 2 and 4 that last a frame; back to the beginning it is 7."""
    found = facts([0, 1, 3, 7])
    assert (found.minimum, found.maximum) == (0, 7)
    assert (found.speed, found.speed_frame) == (pytest.approx(7 / 0.02), 0)
    assert (found.step, found.step_s, found.step_needs_s) == (None, None, None)
    ends = facts([0, 1, 3, 7], loop_start=3)
    assert (ends.speed, ends.speed_frame) == (pytest.approx(2 / 0.02), 2)
    assert (ends.step, ends.step_s) == (4, pytest.approx(0.04))  # the last angle stays


def test_a_change_that_the_servo_reaches_in_a_frame_is_a_ramp() -> None:
    """One radian is reached, a little more is a step that lasts as long as the angle."""
    found = facts([0, 0, 1, 1, 1])
    assert (found.speed, found.speed_frame, found.step) == (pytest.approx(50), 2, None)
    more = facts([0, 0, 1.001, 1.001, 1.001])
    assert (more.speed, more.speed_frame) == (None, None)
    assert (more.step, more.step_s) == (pytest.approx(1.001), pytest.approx(0.06))
    assert more.step_needs_s == pytest.approx(1.001 / 50)


def test_of_ramps_and_steps_the_greatest_count() -> None:
    found = facts([0, 0, 0.5, 0.5, 5, 5, 5, 2, 2], loop_start=8)
    assert (found.speed, found.speed_frame) == (pytest.approx(25), 2)
    assert (found.step, found.step_s) == (4.5, pytest.approx(0.06))


def test_without_a_stated_speed_all_that_lasts_is_a_step() -> None:
    found = facts([0, 0, 0.001, 0.001], loop_start=3, speed=None)
    assert (found.speed, found.step, found.step_needs_s) == (None, pytest.approx(0.001), None)


def test_angles_within_a_nanoradian_are_one() -> None:
    assert facts([0, 1e-9, 0, 1e-9]).step is None
    assert facts([0, 1e-9, 0, 1e-9]).speed is None
    assert facts([0, 2e-9, 0, 2e-9]).speed == pytest.approx(2e-9 / 0.02)


def test_the_last_angle_of_a_loop_that_goes_on_is_not_cut_short() -> None:
    """Three frames of 5 at the end and two more at the beginning: the step lasts five frames."""
    found = facts([5, 5, 0, 0, 0, 0, 5, 5, 5])
    assert (found.step, found.step_s) == (5, pytest.approx(0.08))
    assert facts([0, 0, 0, 5, 5, 5]).step_s == pytest.approx(0.06)


def test_frames_without_pulses_are_passed_over() -> None:
    found = facts([0, 0, NAN, 5, 5, NAN, NAN], loop_start=6)
    assert (found.minimum, found.maximum, found.step, found.step_s) == (0, 5, 5, pytest.approx(0.04))
    still = facts([NAN, 2, 2, NAN], loop_start=3)
    assert (still.minimum, still.maximum, still.speed, still.step) == (2, 2, None, None)


def test_a_continuous_servo_has_a_range_of_speeds_only() -> None:
    found = facts([0, 5, -5, NAN], continuous=True)
    assert (found.minimum, found.maximum) == (-5, 5)
    assert (found.speed, found.speed_frame, found.step, found.step_s) == (None,) * 4


def test_servos_that_never_have_a_pulse_are_left_out() -> None:
    servos = [
        SimpleNamespace(name=name, model=SimpleNamespace(speed=50.0, continuous=False)) for name in "ab"
    ]
    clock = SimpleNamespace(seconds=lambda cycles: 0.02)
    trajectory = SimpleNamespace(clock=clock, period=1, loop_start=0, angles=np.array([[NAN, 1], [NAN, 2]]))
    (found,) = servo_facts(SimpleNamespace(servos=servos, trajectory=trajectory))  # type: ignore[arg-type]
    assert (found.servo.name, found.minimum, found.maximum) == ("b", 1, 2)


def test_the_json_of_a_servo_has_its_limits_and_needs() -> None:
    model = SimpleNamespace(name="m", continuous=False, speed=math.pi)
    servo: Any = SimpleNamespace(name="a", pin="RB0", model=model, limits=(-math.pi / 2, math.pi))
    assert ServoFacts(servo, 0.0, math.pi / 4, math.pi / 3, 4, math.pi / 2, 0.5).to_json() == {
        "name": "a",
        "pin": "RB0",
        "model": "m",
        "continuous": False,
        "minimum_deg": 0.0,
        "maximum_deg": 45.0,
        "lower_limit_deg": -90.0,
        "upper_limit_deg": 180.0,
        "peak_speed_deg_s": pytest.approx(60),
        "peak_speed_frame": 4,
        "speed_limit_deg_s": 180.0,
        "largest_step_deg": 90.0,
        "step_needs_s": 0.5,
        "step_has_s": 0.5,
    }
