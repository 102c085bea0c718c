"""Bent calibrations: the player follows each as two straight lines, and a robot that has them fits like any
other.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from servogen.engines.firmware import ResourceError
from servogen.engines.player.arithmetic import FRACTION
from servogen.engines.player.encoding import WidthScale
from servogen.engines.player.engine import play
from servogen.engines.player.firmware import compiled
from servogen.engines.player.knees import MAX_BEND, Knees, knees_of
from servogen.job import PlannedJob, load, plan_job
from servogen.robot.servo import Servo, calibration, servo
from servogen.robot.servo_models import servo_model
from servogen.units import Clock
from servogen.workflows import engines
from servogen.workflows.job_build import judge_firmware

CASE = Path(__file__).parent / "cal3" / "cal3-three-points.toml"
"""Twelve servos measured at three points, the middle one up to 48 µs off the line between the others."""
CLOCK = Clock(4_000_000)


def own(*points: tuple[float, float], **choices: float) -> Servo:
    curve = calibration(tuple((math.radians(angle), width) for angle, width in points))
    return servo("own", "RB0", servo_model("futaba-s3001"), points=curve, **choices)  # type: ignore[arg-type]


@pytest.mark.parametrize("bend", [-MAX_BEND, -7, 7, MAX_BEND])
@pytest.mark.parametrize("shift", [1, 2, 3])
def test_beyond_its_knee_a_channel_is_steeper_by_its_bend(shift: int, bend: int) -> None:
    """By hand: base + value steps, and bend/256 of what lies beyond the knee, rounded to a cycle each."""
    knees = Knees(np.array([1000.0 + (90 << shift)]), np.array([bend]))
    scale = WidthScale(np.array([1000]), np.array([shift])).with_knees(knees)
    steps = np.arange(0, 250, 0.25)
    widths = scale.widths((steps * (1 << FRACTION)).astype(np.int64)[:, None])[:, 0]
    expected = 1000 + (steps + np.maximum(steps - 90, 0) * bend / 256) * (1 << shift)
    assert np.abs(widths - expected).max() <= 2


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("falling", [False, True])
def test_straightened_widths_are_as_straight_as_the_angles(reverse: bool, falling: bool) -> None:
    points = ((0.0, 1000.0), (80.0, 1430.0), (180.0, 2000.0))
    if falling:
        points = tuple((180 - angle, width) for angle, width in points)  # type: ignore[assignment]
    arm = own(*points, reverse=reverse, trim_us=7.0)
    angles = np.radians(np.linspace(20, 160, 141))
    rows = np.array([[arm.width_us(angle)] for angle in angles])
    knees = knees_of([arm], [0], rows, CLOCK)

    def off_a_line(widths: np.ndarray) -> float:
        return float(np.abs(widths - np.polyval(np.polyfit(angles, widths, 1), angles)).max())

    assert off_a_line(rows[:, 0]) > 5
    assert off_a_line(knees.straightened(rows)[:, 0]) < 1  # a 256th of 700 µs is 3 µs


def test_of_many_points_the_knee_is_the_one_that_leaves_least() -> None:
    """Points on two lines, 5 and 5.5 µs per degree, that meet at 100°; one of the others is 1 µs off."""
    arm = own((0, 1000), (40, 1201), (70, 1350), (100, 1500), (140, 1720), (180, 1940))
    knees = knees_of([arm], [0], np.array([[1010.0], [1930.0]]), CLOCK)
    assert (knees.widths.tolist(), knees.bends.tolist()) == ([1500.0], [round(256 * 0.1)])


def test_straight_calibrations_and_knees_that_the_motion_does_not_reach_are_none() -> None:
    straight = own((0, 1000), (90, 1500), (180, 2000))
    bent = own((0, 1000), (90, 1450), (180, 2000))
    for arm, turns, low in ((straight, [0], 1100.0), (bent, [0], 1500.0), (bent, [], 1100.0)):
        assert not knees_of([arm], turns, np.array([[low], [1900.0]]), CLOCK).bends.any()
    assert knees_of([bent], [0], np.array([[1100.0], [1900.0]]), CLOCK).bends.any()


@pytest.fixture(scope="module")
def walk() -> PlannedJob:
    return plan_job(load(CASE))


@pytest.mark.campaign
def test_a_robot_with_three_measured_points_fits_and_is_exact(walk: PlannedJob) -> None:
    """Its two-point twin is within 8.7 µs; without knees it is 18.8 µs off, and refused."""
    played = engines.planned(walk)
    schedule = played.plan.schedule
    assert schedule.plan_error_us <= 10
    assert judge_firmware(schedule, played.make("c2c")).exact


def test_a_knee_farther_on_is_seen_in_the_edges(walk: PlannedJob) -> None:
    _, played, schedule = play(walk)
    scale = played.encoded.scale
    assert scale.bent
    other = replace(played.encoded, scale=replace(scale, knees=scale.knees + 30))
    firmware = compiled(walk, replace(played, encoded=other), "c2c")
    verdict = judge_firmware(schedule, firmware).verdict
    assert not verdict.passed and any("RF-alpha" in reason for reason in verdict.reasons)


def test_where_knees_have_no_room_the_servo_is_named(
    walk: PlannedJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise ResourceError("does-not-fit", "no room")

    monkeypatch.setattr("servogen.engines.player.firmware.compiled", refused)
    with pytest.raises(ResourceError) as caught:
        engines.planned(walk)
    assert caught.value.code == "beyond-max-error"
    assert "the calibration of RF-alpha is bent: a point is 48.0 µs off a straight line" in str(caught.value)
