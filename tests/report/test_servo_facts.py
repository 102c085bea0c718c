"""What a motion asks of its servos."""

import math

import pytest

from servogen.job import loads, plan_job
from servogen.report.plan_facts import ServoFacts, servo_facts

HEAD = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "mpx-tiny-s"
[motion]
"""


def facts(motion: str) -> ServoFacts:
    (found,) = servo_facts(plan_job(loads(HEAD + motion, "job.toml")))
    return found


def degrees(value: float | None) -> float:
    assert value is not None
    return math.degrees(value)


def test_a_move_in_a_stated_time_asks_for_its_travel_over_its_time() -> None:
    found = facts("poses = [{ arm_deg = 30, move_s = 0.5 }, { arm_deg = 90, move_s = 0.24 }]")
    assert (degrees(found.minimum), degrees(found.maximum)) == pytest.approx((30, 90), abs=3)
    assert degrees(found.speed) == pytest.approx(60 / 0.24)
    assert found.step is None


def test_a_change_at_once_is_a_step_with_the_time_to_make_it() -> None:
    found = facts("poses = [{ arm_deg = 30, hold_s = 1 }, { arm_deg = 105, hold_s = 0.5 }]")
    assert degrees(found.step) == pytest.approx(75)
    assert found.step_needs_s == pytest.approx(75 / 750)
    assert found.step_s == pytest.approx(0.5)
    assert found.speed is None


def test_the_way_from_the_loops_end_to_its_beginning_counts() -> None:
    found = facts(
        "poses = [{ arm_deg = 30, hold_s = 1 }, { arm_deg = 60, hold_s = 1 }, { arm_deg = 105, hold_s = 1 }]"
    )
    assert degrees(found.step) == pytest.approx(75)


def test_a_servo_that_never_moves_has_a_range_and_nothing_else() -> None:
    found = facts("poses = [{ arm_deg = 30, hold_s = 1 }]")
    assert degrees(found.minimum) == degrees(found.maximum) == pytest.approx(30)
    assert (found.speed, found.step) == (None, None)


def test_a_loop_without_pulses_keeps_what_came_before_it() -> None:
    found = facts(
        'repeat = false\nend = "release"\n'
        "poses = [{ arm_deg = 30, hold_s = 1 }, { arm_deg = 120, hold_s = 1 }]"
    )
    assert degrees(found.step) == pytest.approx(90)
    assert found.step_s == pytest.approx(1)
