"""A stream engine moves a pose that takes long to send as a group: all servos start and arrive together."""

import math
from itertools import pairwise

import numpy as np
import pytest

from servogen.drive.controller import controller_of
from servogen.drive.line import Line
from servogen.drive.motions import Limited, Motion
from servogen.drive.session import Session
from servogen.job import Job, loads
from servogen.motion.trajectory import Floats
from tests.drive.mini_ssc import Robot

GROUP = 0x80
FRAME_S = 0.02


class Sine:
    def __init__(self, count: int) -> None:
        self.count = count

    def at(self, seconds: float) -> Floats:
        return np.full(self.count, math.pi / 2 + math.sin(3 * seconds))


def stream(count: int, clock_hz: int = 4_000_000, baud: int = 2400) -> Job:
    text = f'[chip]\ndevice = "PIC16F84A"\nclock_hz = {clock_hz}\n[stream]\nbaud = {baud}\n'
    for index in range(count):
        text += f'[[servo]]\nname = "s{index}"\npin = "RB{index}"\nmodel = "futaba-s3001"\n'
    return loads(text, "job.toml")


def driven(job: Job, motion: Motion, robot: Robot, stop: Floats | None = None) -> Session:
    baud, controller = controller_of(job, None, None, 0)
    with Line(robot.open, baud, robot.time(), 10.0) as line:
        session = Session(controller, line, robot.time(), lambda entry: None, stop)
        session.run(motion)
    return session


def groups(arrived: list[tuple[float, int, int]]) -> list[tuple[list[int], int]]:
    """(servos, frames) of each group; a position outside of one is a group of its own, of no frames."""
    found: list[tuple[list[int], int]] = []
    waiting: list[int] | None = None
    for _, number, value in arrived:
        if number == GROUP and value == 0:
            waiting = []
        elif number == GROUP:
            assert waiting is not None, "a group goes that never began"
            found.append((waiting, value))
            waiting = None
        elif waiting is None:
            found.append(([number], 0))
        else:
            waiting.append(number)
    return found


def test_eight_servos_that_move_are_one_group_after_the_other() -> None:
    robot = Robot(2400)
    driven(stream(8), Limited(Sine(8), 3.0), robot)
    found = groups(robot.arrived)
    assert len(found) > 20
    for servos, frames in found:
        assert servos == list(range(8))
        assert frames == round(10 * 0.0125 / FRAME_S), "as long as the next group takes to come"


@pytest.mark.parametrize(("count", "clock_hz", "baud"), [(3, 4_000_000, 2400), (8, 16_000_000, 9600)])
def test_what_is_sent_within_two_frames_needs_no_group(count: int, clock_hz: int, baud: int) -> None:
    robot = Robot(baud)
    driven(stream(count, clock_hz, baud), Limited(Sine(count), 1.0), robot)
    assert {frames for _, frames in groups(robot.arrived)} == {0}


def test_in_groups_a_servo_goes_on_by_small_steps_where_one_by_one_it_would_jump() -> None:
    robot = Robot(2400)
    driven(stream(8), Limited(Sine(8), 3.0), robot)
    positions = [value for _, number, value in robot.arrived if number == 0]
    frames = [each for _, each in groups(robot.arrived)]
    steps = [
        abs(after - before) / each
        for (before, after), each in zip(pairwise(positions), frames[1:], strict=True)
    ]
    fastest = 3 * 254 / math.pi  # positions a second
    assert max(steps) <= fastest * FRAME_S + 1 < fastest * 8 * 0.0125


def test_a_group_that_was_cut_off_is_ended_before_anything_else_is_sent() -> None:
    robot = Robot(2400, faults=[(0.40, 1.0)])
    session = driven(stream(8), Limited(Sine(8), 1.0), robot)
    assert session.summary.outages == 1
    before = [each for each in robot.arrived if each[0] < 0.45]
    after = [each[1:] for each in robot.arrived if each[0] > 1.3]
    begins = sum(1 for each in before if each[1] == GROUP and each[2] == 0)
    goes = sum(1 for each in before if each[1] == GROUP and each[2] > 0)
    assert begins == goes + 1, "the outage came in the middle of a group"
    assert after[0] == (GROUP, 1)
    assert after[1] == (GROUP, 0)
    assert [number for number, _ in after[2:10]] == list(range(8))


def test_a_stop_in_the_middle_of_a_group_is_not_kept_waiting() -> None:
    robot = Robot(2400)

    def interrupt() -> None:
        if robot.now > 0.40:
            robot.after_wait = lambda: None
            raise KeyboardInterrupt

    robot.after_wait = interrupt
    job = stream(8)
    stop = np.array([servo.neutral for servo in job.servos])
    with pytest.raises(KeyboardInterrupt):
        driven(job, Sine(8), robot, stop)
    last = [each[1:] for each in robot.arrived[-9:]]
    assert last == [(GROUP, 1), *((number, 127) for number in range(8))]


def test_a_chip_with_a_fail_safe_hears_something_four_times_in_its_patience() -> None:
    job = loads(
        '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n[stream]\nsilence_s = 0.4\n'
        '[[servo]]\nname = "s"\npin = "RB0"\nmodel = "futaba-s3001"\n',
        "job.toml",
    )
    robot = Robot(2400)
    driven(job, Limited(Sine(1), 0.0), robot)  # one pose
    robot = Robot(2400)

    class Rest:
        def at(self, seconds: float) -> Floats:
            return np.array([1.0])

    driven(job, Limited(Rest(), 3.0), robot)
    moments = [moment for moment, _, _ in robot.arrived]
    assert np.diff(moments).max() <= 0.4 / 4 + 0.02
