"""What a motion demands of a servo: ramps, steps and the frames between, of angles made by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.report.plan_facts import ServoFacts, servo_facts

NAN = math.nan


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
