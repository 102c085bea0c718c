"""A stream engine goes to the first pose as a group: all servos start and arrive together."""

import math

import numpy as np
import pytest

from servogen.drive.controller import job_controller
from servogen.drive.motions import AngleFunction, Limited, Still
from servogen.drive.serial_link import SerialLink
from servogen.drive.session import DriveSession
from servogen.job import PlannedJob, loads, plan_job
from servogen.motion.trajectory import Floats
from tests.drive.mini_ssc import Robot

GROUP, SPEED = 0x80, 0x40
FRAME_S = 0.02


class Sine:
    def __init__(self, count: int) -> None:
        self.count = count

    def at(self, seconds: float) -> Floats:
        return np.full(self.count, math.pi / 2 + math.sin(3 * seconds))


def stream(count: int, silence_s: float = 1.0) -> PlannedJob:
    text = '[chip]\ndevice = "PIC16F84A"\nclock_hz = 4_000_000\n'
    for index in range(count):
        text += f'[[servo]]\nname = "s{index}"\npin = "RB{index}"\nmodel = "futaba-s3001"\n'
    return plan_job(loads(text + f"[stream]\nsilence_s = {silence_s}\n", "job.toml"))


def driven(
    job: PlannedJob, motion: AngleFunction, robot: Robot, stop: Floats | None = None, arrive_s: float = 1.0
) -> DriveSession:
    baud, controller = job_controller(job, None, None, 0)
    with SerialLink(robot.open, baud, robot.time(), 10.0) as line:
        session = DriveSession(controller, line, robot.time(), lambda entry: None, stop, arrive_s=arrive_s)
        session.run(motion)
    return session


def commands(robot: Robot) -> list[tuple[int, int]]:
    return [(number, value) for _, number, value in robot.arrived]


def test_the_first_pose_is_a_group_and_the_motion_waits_for_it() -> None:
    robot = Robot(2400)
    driven(stream(8), Limited(Sine(8), 2.0), robot)
    sent = commands(robot)
    assert sent[0] == (GROUP, 0)
    assert [number for number, _ in sent[1:9]] == list(range(8))
    assert sent[9] == (GROUP, round(1.0 / FRAME_S))
    first = next(moment for moment, number, _ in robot.arrived[10:] if number < 8)
    assert first >= robot.arrived[9][0] + 1.0
    assert not any(number == GROUP for number, _ in sent[10:])


def test_without_a_time_the_first_pose_is_sent_as_any_other() -> None:
    robot = Robot(2400)
    driven(stream(2), Limited(Still(np.zeros(2)), 0.0), robot, arrive_s=0.0)
    assert commands(robot) == [(0, 0), (1, 0)]


def test_a_controller_that_is_no_stream_engine_is_sent_no_group() -> None:
    job = stream(2)
    robot = Robot(9600)
    baud, controller = job_controller(job, 9600, "500,2500", 0)
    with SerialLink(robot.open, baud, robot.time(), 10.0) as line:
        DriveSession(controller, line, robot.time(), lambda entry: None).run(Limited(Sine(2), 1.0))
    assert {number for number, _ in commands(robot)} == {0, 1}


def test_after_an_outage_the_pose_is_a_group_again() -> None:
    robot = Robot(2400, faults=[(2.0, 1.0)])
    session = driven(stream(8), Limited(Sine(8), 2.0), robot)
    assert session.summary.outages == 1
    after = [each[1:] for each in robot.arrived if each[0] > 2.9]
    assert after[0] == (GROUP, 0)
    assert [number for number, _ in after[1:9]] == list(range(8))
    assert after[9] == (GROUP, round(1.0 / FRAME_S))


def test_a_group_that_an_outage_cut_off_is_begun_again() -> None:
    robot = Robot(2400, faults=[(0.06, 1.0)])
    driven(stream(8), Limited(Sine(8), 0.5), robot)
    sent = commands(robot)
    assert [each for each in sent if each[0] == GROUP] == [(GROUP, 0), (GROUP, 0), (GROUP, 50)]


def test_a_stop_in_the_middle_of_a_group_is_not_kept_waiting() -> None:
    robot = Robot(2400)

    def interrupt() -> None:
        if robot.now > 0.06:
            robot.after_wait = lambda: None
            raise KeyboardInterrupt

    robot.after_wait = interrupt
    job = stream(8)
    stop = np.array([servo.neutral for servo in job.servos])
    with pytest.raises(KeyboardInterrupt):
        driven(job, Sine(8), robot, stop)
    assert commands(robot)[-9:] == [(GROUP, 1), *((number, 127) for number in range(8))]


@pytest.mark.parametrize("motion", [Still(np.array([1.0])), Sine(1)])
def test_a_chip_with_a_fail_safe_hears_something_four_times_in_its_patience(motion: AngleFunction) -> None:
    robot = Robot(2400)
    driven(stream(1, silence_s=0.4), Limited(motion, 3.0), robot)
    moments = [moment for moment, _, _ in robot.arrived]
    assert np.diff(moments).max() <= 0.4 / 4 + 0.02
    waiting = [(number, value) for moment, number, value in robot.arrived if 0.2 < moment < 0.9]
    assert waiting
    assert set(waiting) == {(SPEED, 0)}, "which changes nothing and disturbs no group"
