"""A schedule says how far its pulses are from the motion that was planned, before anything was rounded."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import load, loads, plan_job
from servogen.plan_error import NO_PLAN, PlanError, plan_text
from servogen.pulse import PulseSchedule, from_json
from servogen.pulse.quantise import channel_error, largest
from servogen.robot.servo import servo
from servogen.robot.servo_models import servo_model
from servogen.workflows.engines import planned

JOBS = Path(__file__).parents[2] / "jobs"


def schedule_of(job: str) -> PulseSchedule:
    return planned(plan_job(load(JOBS / f"{job}.toml"))).plan.schedule


def test_the_lab_exercise_is_a_third_of_a_microsecond_off() -> None:
    """30° is 1166.67 µs and becomes 1167; 180° are 1000 µs, so that a third of a µs is 0.06°."""
    assert schedule_of("lab8-exercise").plan_error == PlanError(0.333, angle_deg=0.06)


def test_a_player_is_held_against_the_motion_and_not_against_its_poses() -> None:
    """A Tiny-S turns 180° in 500 µs: 1.487 µs are 0.535°."""
    error = schedule_of("hexapod-tripod").plan_error
    assert error is not None
    assert error.width_us == 1.487
    assert error.angle_deg == pytest.approx(1.487 * 180 / 500, abs=0.001)


def test_a_wheel_has_an_error_of_its_speed() -> None:
    """The example servo turns 300°/s faster for 200 µs."""
    error = schedule_of("omni-square").plan_error
    assert error is not None
    assert error.angle_deg is None
    assert error.speed_deg_s == pytest.approx(error.width_us * 300 / 200, abs=0.002)
    assert error.end == "base"


def test_the_foot_is_as_far_off_as_the_legs_formula_says() -> None:
    """X = -r sin α - l_BC cos α sin β, Y = r cos α - l_BC sin α sin β, Z = -l_BC cos β - l_DF, by hand."""
    job = plan_job(load(JOBS / "lab9-exercise.toml"))
    schedule = planned(job).plan.schedule

    def foot(vertical_us: Any, horizontal_us: Any) -> Any:
        beta, alpha = (np.radians((us - 1500) * 180 / 500) for us in (vertical_us, horizontal_us))
        s, r = 40 * np.sin(beta), 65
        return np.stack(
            [
                -r * np.sin(alpha) - s * np.cos(alpha),
                r * np.cos(alpha) - s * np.sin(alpha),
                -40 * np.cos(beta) - 60,
            ]
        )

    asked = 1500 + (np.degrees(job.trajectory.angles) - 90) * 500 / 180
    runs = (*schedule.lead_in, *schedule.loop)
    rows = [[pulse.width for pulse in run.pulses if pulse] for run in runs]
    made = np.repeat(np.array(rows), [run.frames for run in runs], axis=0)
    away = np.linalg.norm(foot(*made.T) - foot(*asked.T), axis=0).max()
    assert schedule.plan_error is not None
    assert schedule.plan_error.end == "foot"
    assert schedule.plan_error.end_mm == pytest.approx(away, abs=0.001)


def test_the_largest_of_each_kind_counts_whichever_servo_has_it() -> None:
    errors = [PlanError(0.2, 0.5), PlanError(0.4, 0.1), PlanError(0.1, speed_deg_s=0.25)]
    assert largest(errors) == PlanError(0.4, 0.5, 0.25)
    assert largest([]) == PlanError(0.0)


def test_a_falling_calibration_and_a_mirrored_servo_have_the_same_error() -> None:
    model = servo_model("futaba-s3001")
    for reverse in (False, True):
        one = servo("arm", "RB0", model, reverse=reverse)
        angles = np.array([math.radians(30), math.radians(90)])
        wanted = np.array([one.width_us(angle) for angle in angles.tolist()])
        error = channel_error(one, angles, wanted, wanted + np.array([0.0, -2.5]))
        assert error.width_us == pytest.approx(2.5)
        assert error.angle_deg == pytest.approx(0.45)


def test_the_numbers_survive_the_file() -> None:
    schedule = schedule_of("hexapod-tripod")
    assert schedule.plan_error is not None
    assert schedule.device == "PIC16F84"
    assert from_json(schedule.json_text(), "schedule.json") == schedule


def test_a_schedule_without_a_plan_says_so() -> None:
    data = json.loads(schedule_of("lab8-exercise").json_text())
    del data["plan_error"], data["device"]
    read = from_json(json.dumps(data), "schedule.json")
    assert read.plan_error is None
    assert read.device is None
    assert plan_text(read.plan_error) == NO_PLAN == "no plan to compare with"


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("width_us", -1, "plan_error.width_us: is not a number from 0"),
        ("width_us", float("nan"), "plan_error.width_us: is not a number from 0"),
        ("angle_deg", "6.8", "plan_error.angle_deg: is not a number from 0"),
        ("end", 5, "plan_error.end: is not a text"),
        ("end", "foot", "has only one of 'end' and 'end_mm'"),
        ("end_mm", 1.0, "has only one of 'end' and 'end_mm'"),
        ("width", 1.0, "plan_error.width: unknown key"),
    ],
)
def test_a_wrong_plan_error_is_refused_with_its_key(key: str, value: object, words: str) -> None:
    data = json.loads(schedule_of("lab8-exercise").json_text())
    data["plan_error"][key] = value
    if key == "end" and value == 5:
        data["plan_error"]["end_mm"] = 1.0
    with pytest.raises(InputError, match=words):
        from_json(json.dumps(data), "schedule.json")


def test_a_device_that_is_not_a_text_is_refused() -> None:
    data = json.loads(schedule_of("lab8-exercise").json_text())
    data["device"] = 84
    with pytest.raises(InputError, match="device: is not a text"):
        from_json(json.dumps(data), "schedule.json")


def test_a_motion_of_whole_cycles_has_no_error() -> None:
    job = plan_job(
        loads(
            '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
            '[[servo]]\nname = "arm"\npin = "RB0"\nmodel = "futaba-s3001"\n'
            "[motion]\nposes = [{ arm_deg = 90, hold_s = 1 }]\n",
            "job.toml",
        )
    )
    assert planned(job).plan.schedule.plan_error == PlanError(0.0, 0.0)
