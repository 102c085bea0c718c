"""Tracks, sticks and the page's robot against geometry worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from servogen.edges import PINS
from servogen.job import load, loads, plan_job
from servogen.job.ends import to_place
from servogen.kinematics.leg_kinds import LEG_KINDS
from servogen.pulse import Channel, Pulse, PulseSchedule, Run
from servogen.report import robot_model
from servogen.report.drawing import PALETTE
from servogen.report.tracks import EndError, Track, end_errors, error_rows, largest_error, made_angles
from servogen.units import Clock, Cycles

JOBS = Path(__file__).parents[2] / "jobs"
NAN = math.nan


def track(name: str, made: list[list[float]], shift: list[list[float]] | None = None) -> Track:
    """A track whose points were planned at the origin."""
    points = np.array(made)
    planned = np.where(np.isnan(points), np.nan, 0.0)
    return Track(name, "foot", planned, points, points if shift is None else np.array(shift))


def test_an_error_is_a_distance_and_its_worst_the_first_within_a_nanometre() -> None:
    """3-4-0 mm and 0-3-4 mm are 5 mm; the rms of 0, 5, 5 and 5 mm is 5 √(3/4)."""
    rows = [[0, 0, 0], [0.003, 0.004, 0], [0, 0.003, 0.0040000000001], [0.005, 0, 0], [NAN] * 3]
    found = track("L1", rows, [[0, 0, 0], [0, 0, 0.001], [0, 0, 0], [0, 0.0, 0], [NAN] * 3])
    assert found.error == pytest.approx([0, 0.005, 0.005, 0.005, NAN], nan_ok=True)
    (error,) = end_errors([found, track("R1", [[NAN] * 3])])
    assert (error.name, error.kind, error.frame) == ("L1", "foot", 1)
    assert error.worst_m == pytest.approx(0.005)
    assert error.rms_m == pytest.approx(0.005 * math.sqrt(3 / 4))
    assert error.first_order_worst_m == pytest.approx(0.001)
    assert error.first_order_rms_m == pytest.approx(0.0005)
    assert error.to_json() == {
        "worst_m": error.worst_m,
        "rms_m": error.rms_m,
        "frame": 1,
        "jacobian_worst_m": error.first_order_worst_m,
        "jacobian_rms_m": error.first_order_rms_m,
    }


def error(name: str, worst: float) -> EndError:
    return EndError(name, "foot", worst, 0.002, 3, 0.0015, 0.0025)


def test_the_worst_end_is_the_first_within_a_nanometre() -> None:
    assert largest_error([error("a", 0.001), error("b", 0.001000002), error("c", 0.0009)]).name == "b"
    assert largest_error([error("a", 0.001), error("b", 0.0010000000001)]).name == "a"


def test_errors_are_shown_in_millimetres_and_seconds() -> None:
    assert list(error_rows([error("a", 0.00123456)], 0.02)) == [
        ("a", "1.2346", "2.0000", "3", "0.06", "1.5000", "2.5000")
    ]


def test_angles_are_read_back_from_whole_cycles() -> None:
    """1 ms at 0°, 0.5 ms more at 90°: with half a microsecond a cycle 2500 cycles are 45°."""
    servo = load(JOBS / "lab8-exercise.toml").servos[0]
    runs = (
        Run(1, (Pulse(Cycles(0), Cycles(2500)),)),
        Run(2, (None,)),
        Run(1, (Pulse(Cycles(9), Cycles(2000)),)),
    )
    schedule = PulseSchedule(Clock(8_000_000), Cycles(40_000), (Channel("a", "RB0", ""),), runs[:1], runs[1:])
    found = np.degrees(made_angles(schedule, [servo]))
    assert found[:, 0] == pytest.approx([45, NAN, NAN, 0], nan_ok=True, abs=1e-9)


def test_points_are_turned_and_moved_to_their_place() -> None:
    """A quarter turn about z, then 1, 2, 3."""
    place = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
    assert to_place(place, np.array([[1.0, 0, 0], [0, 1, 5]])) == pytest.approx(
        np.array([[1, 3, 3], [0, 2, 8]])
    )


def test_the_corners_of_a_leg_are_those_of_the_drawing() -> None:
    """At α = β = 0 it goes outward along y, hangs down BC, outward again, and down DF; β swings BC back."""
    arm: Any = SimpleNamespace(length={"ab": 0.03, "bc": 0.06, "cd": 0.02, "df": 0.08})
    angles = np.array([[0.0, 0], [0, math.pi / 2], [math.pi / 2, 0]])
    down, back, turned = LEG_KINDS["pantograph"].corners(arm, angles)
    assert down == pytest.approx(
        np.array([[0, 0, 0], [0, 0.03, 0], [0, 0.03, -0.06], [0, 0.05, -0.06], [0, 0.05, -0.14]])
    )
    assert back == pytest.approx(
        np.array([[0, 0, 0], [0, 0.03, 0], [-0.06, 0.03, 0], [-0.06, 0.05, 0], [-0.06, 0.05, -0.08]])
    )
    assert turned == pytest.approx(
        np.array([[0, 0, 0], [-0.03, 0, 0], [-0.03, 0, -0.06], [-0.05, 0, -0.06], [-0.05, 0, -0.14]])
    )


def test_the_page_has_a_servos_widths_with_its_trim_and_its_angles_as_mounted() -> None:
    """A reversed servo of 180°: its widths rise and its angles fall."""
    text = (JOBS / "lab8-exercise.toml").read_text().replace("trim_us = 0", "trim_us = 7\nreverse = true")
    servo = loads(text, "job.toml").servos[0]
    found: Any = robot_model.servo_model(servo, 14)
    assert found["colour"] == PALETTE[1]  # of thirteen
    assert found["pin"] == PINS.index(servo.pin)
    points = sorted(servo.calibration.points, key=lambda point: point.width_us)
    assert found["widths_us"] == [point.width_us + 7 for point in points]
    assert found["angles"] == pytest.approx([math.pi - point.angle for point in points])
    assert (found["limits"], found["neutral"]) == (list(servo.limits), servo.neutral)
    assert found["continuous"] is False


@pytest.mark.parametrize(("speed", "shown"), [(None, 1000.0), (5.0, 5.0)])
def test_a_servo_without_a_stated_speed_moves_at_once_on_the_page(speed: float | None, shown: float) -> None:
    from dataclasses import replace

    servo = load(JOBS / "lab8-exercise.toml").servos[0]
    own = replace(servo, model=replace(servo.model, speed=speed))
    assert robot_model.servo_model(own, 0)["speed"] == shown


def test_a_schedule_of_known_servos_can_be_shown_without_its_job() -> None:
    run = Run(1, (None, None))
    channels = (Channel("a", "RB0", "futaba-s3001"), Channel("b", "RB1", "futaba-s3001"))
    schedule = PulseSchedule(Clock(4_000_000), Cycles(20_000), channels, (), (run,))
    found: Any = robot_model.schedule_model(schedule)
    assert [servo["name"] for servo in found["servos"]] == ["a", "b"]
    assert (found["ends"], found["body"], found["base"]) == ([], [], None)
    other = (channels[0], Channel("b", "RB1", "own"))
    unknown = PulseSchedule(Clock(4_000_000), Cycles(20_000), other, (), (run,))
    assert robot_model.schedule_model(unknown) is None


def test_the_body_of_a_page_goes_around_its_mounts_and_an_arm_has_none() -> None:
    """Counter-clockwise from -180°, so that no edges cross."""
    found: Any = robot_model.robot_model(plan_job(load(JOBS / "hexapod-tripod.toml")))
    angles = [math.atan2(y, x) for x, y, _ in found["body"]]
    assert len(angles) == 6
    assert angles == sorted(angles)
    assert found["base"] is None
    assert {tuple(end["leg"]) for end in found["ends"]} == {("ab", "bc", "cd", "df")}
    arm: Any = robot_model.robot_model(plan_job(load(JOBS / "scara-pick.toml")))
    assert (arm["body"], len(arm["ends"])) == ([], 1)
    assert [row["turning"] for row in arm["ends"][0]["rows"]].count(False) == 1  # the joint that slides
    base: Any = robot_model.robot_model(plan_job(load(JOBS / "omni-square.toml")))["base"]
    assert np.array(base["speeds"]).shape == (3, 3)
    assert base["wheels"] == [0, 1, 2]
    assert SimpleNamespace(**base).outline
