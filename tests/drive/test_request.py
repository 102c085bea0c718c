"""What a drive is asked to do: how long it lasts, how it ends, and what takes its commands."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from servogen.drive.motions import Limited, Played, Still
from servogen.drive.request import HOLD, NEUTRAL, OFF, DriveRequest, plan_course
from servogen.errors import InputError
from servogen.job import PlannedJob, loads, plan_job
from tests.drive.conftest import planned

STREAM = """
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "futaba-s3001"
[stream]
fail_safe = "{fail_safe}"
"""


def stream(fail_safe: str) -> PlannedJob:
    return plan_job(loads(STREAM.format(fail_safe=fail_safe), "job.toml"))


def test_without_more_the_motion_is_driven_until_an_interrupt() -> None:
    course = plan_course(planned("lab8-exercise"), DriveRequest())
    assert isinstance(course.motion, Limited)
    assert isinstance(course.motion.motion, Played)
    assert course.seconds == math.inf
    assert course.stop is None


def test_a_steered_robot_is_driven_until_an_interrupt_or_for_its_time() -> None:
    wheels = planned("omni-square")
    for seconds, lasts in ((None, math.inf), (2.5, 2.5), (0.0, 0.0)):
        course = plan_course(wheels, DriveRequest(steer=True, seconds=seconds))
        assert course.seconds == lasts
        assert course.motion.at(2.6) is None or lasts > 2.6
        assert course.motion.at(0.0) is not None
        assert course.state is None


def test_a_rehearsal_plays_the_motion_once() -> None:
    """2, 5 and 3 s of the exercise; a time that is given counts in a rehearsal too."""
    exercise = planned("lab8-exercise")
    assert plan_course(exercise, DriveRequest(rehearsal=True)).seconds == 10.0
    assert plan_course(exercise, DriveRequest(rehearsal=True, seconds=25.0)).seconds == 25.0


def test_a_pose_is_sent_and_left_unless_the_robot_would_not_keep_it() -> None:
    pose = DriveRequest(pose="arm=90")
    course = plan_course(planned("lab8-exercise"), pose)
    assert isinstance(course.motion, Limited)
    assert isinstance(course.motion.motion, Still)
    assert course.seconds == 0.0
    assert plan_course(stream(HOLD), pose).seconds == 0.0
    assert plan_course(stream(OFF), pose).seconds == math.inf, "the fail-safe would end it"
    turning = plan_course(planned("omni-square"), DriveRequest(pose="wheel1=100"))
    assert turning.seconds == math.inf, "wheels turn on"
    assert plan_course(stream(OFF), replace(pose, rehearsal=True)).seconds == 0.0
    assert plan_course(stream(OFF), replace(pose, seconds=3.0)).seconds == 3.0


def test_wheels_stop_at_the_end_and_other_servos_hold() -> None:
    wheels = plan_course(planned("omni-square"), DriveRequest()).stop
    assert wheels is not None
    assert wheels.tolist() == [0.0, 0.0, 0.0]
    assert plan_course(planned("omni-square"), DriveRequest(stop=HOLD)).stop is None


def test_the_end_may_be_neutral_or_a_pose() -> None:
    exercise = planned("lab8-exercise")
    neutral, pose = (plan_course(exercise, DriveRequest(stop=stop)).stop for stop in (NEUTRAL, "arm=45"))
    assert neutral is not None
    assert neutral.tolist() == [exercise.servos[0].neutral]
    assert pose is not None
    assert np.degrees(pose).tolist() == pytest.approx([45.0])


def test_only_a_fail_safe_switches_servos_off() -> None:
    assert plan_course(stream(OFF), DriveRequest(stop=OFF)).stop is None
    for other in (stream(HOLD), planned("lab8-exercise")):
        with pytest.raises(InputError, match="cannot switch pulses off"):
            plan_course(other, DriveRequest(stop=OFF))


def test_keys_that_mean_nothing_are_ignored_and_commands_that_mean_nothing_are_refused() -> None:
    wheels = planned("omni-square")
    plan_course(wheels, DriveRequest(steer=True, single_keys=True)).on_command("9")
    with pytest.raises(InputError):
        plan_course(wheels, DriveRequest(steer=True)).on_command("9")


def test_a_pose_and_keys_exclude_each_other() -> None:
    with pytest.raises(InputError, match="use one of the two"):
        plan_course(planned("lab8-exercise"), DriveRequest(pose="1", steer=True))
