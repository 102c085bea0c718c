"""A drive sends what the motion asks for, as fast as the line carries it, and stops the robot at its end."""

import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import pytest

from servogen.drive.commands import script
from servogen.drive.controller import REFRESH_S, ControllerChannel, ServoController, job_controller
from servogen.drive.motions import AngleFunction, Limited, Played, Still, find_pose
from servogen.drive.serial_link import NullWire, SerialLink, VirtualTime
from servogen.drive.session import DriveSession, Summary
from servogen.errors import InputError, Location, ToolError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.motion.trajectory import Floats
from tests.drive.mini_ssc import Robot

JOBS = Path(__file__).parents[2] / "jobs"
LOW, HIGH = 500.0, 2500.0
RANGE = "500,2500"
WIDTHS = tuple(LOW + position * (HIGH - LOW) / 254 for position in range(255))


def servos(count: int) -> PlannedJob:
    """A job of so many equal servos, that all go from 30° to 150° and back in two seconds, endlessly."""
    text = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
    for index in range(count):
        text += f'[[servo]]\nname = "s{index}"\npin = "RB{index}"\nmodel = "futaba-s3001"\n'
    first, second = (", ".join(f"s{i}_deg = {angle}" for i in range(count)) for angle in (30, 150))
    poses = f'{{ name = "low", {first}, move_s = 1 }}, {{ {second}, move_s = 1 }}'
    return plan_job(loads(text + f"[motion]\nposes = [{poses}]\n[frame]\nper_slot = 2\n", "job.toml"))


class Sine:
    """Servo angles that never stand still."""

    def __init__(self, count: int) -> None:
        self.count = count

    def at(self, seconds: float) -> Floats:
        return np.full(self.count, math.pi / 2 + math.sin(3 * seconds))


def driven(
    job: PlannedJob, motion: AngleFunction, robot: Robot, **more: object
) -> tuple[Summary, list[dict[str, object]]]:
    log: list[dict[str, object]] = []
    baud, controller = job_controller(job, robot.baud, RANGE, 0)
    patience: float = more.pop("patience", 10.0)  # type: ignore[assignment]
    with SerialLink(robot.open, baud, robot.time(), patience) as line:
        session = DriveSession(controller, line, robot.time(), log.append, **more)  # type: ignore[arg-type]
        session.run(motion)
    assert robot.open_now == 0
    return session.summary, log


def angle_of(position: int) -> float:
    """Of a Futaba S3001: 1000 µs at 0°, 2000 µs at 180°."""
    return (LOW + position * (HIGH - LOW) / 254 - 1000) / 1000 * math.pi


@pytest.mark.parametrize(("baud", "count"), [(2400, 1), (2400, 8), (9600, 8)])
def test_what_arrives_is_the_motion_no_older_than_one_pose_takes(baud: int, count: int) -> None:
    robot = Robot(baud)
    driven(servos(count), Limited(Sine(count), 3.0), robot)
    pose_s = count * 30 / baud
    step = (HIGH - LOW) / 254 / 1000 * math.pi
    for moment, _, position in robot.arrived[count:]:
        then = [math.pi / 2 + math.sin(3 * (moment - late)) for late in np.linspace(0, pose_s + 1e-6, 50)]
        assert min(then) - step / 2 - 1e-3 <= angle_of(position) <= max(then) + step / 2 + 1e-3


def test_a_moving_robot_keeps_the_line_full() -> None:
    robot = Robot(2400)
    summary, _ = driven(servos(8), Limited(Sine(8), 5.0), robot)
    assert summary.commands / summary.seconds > 0.9 * 80, "80 positions of three bytes a second"
    assert summary.poses_per_second == pytest.approx(10, rel=0.1)
    assert summary.slowest_s == pytest.approx(0.1, rel=0.01)


def test_only_positions_that_changed_are_sent() -> None:
    robot = Robot(9600)
    job = servos(3)
    driven(job, Limited(Still(find_pose(job, "s1=40")), 0.3), robot)
    assert [number for _, number, _ in robot.arrived] == [1]


def test_a_robot_at_rest_is_sent_its_positions_again_in_turn() -> None:
    robot = Robot(9600)
    job = servos(3)
    driven(job, Limited(Still(find_pose(job, "low")), 3.9 * REFRESH_S), robot)
    assert sorted(number for _, number, _ in robot.arrived[3:]) == [0, 1, 2]
    assert len({position for _, _, position in robot.arrived}) == 1


def test_frames_of_a_trajectory_are_played_in_their_own_time() -> None:
    job = servos(1)
    robot = Robot(9600)
    driven(job, Limited(Played(job.trajectory), 5.0), robot)
    for moment, _, position in robot.arrived:
        width = LOW + position * (HIGH - LOW) / 254
        frames = [int((moment - late) / 0.02 + 1e-6) % len(job.trajectory.angles) for late in (0, 0.0085)]
        wanted = [job.servos[0].width_us(float(job.trajectory.angles[frame, 0])) for frame in frames]
        assert min(wanted) - 4 <= width <= max(wanted) + 4


def test_a_motion_that_ends_is_over_at_its_last_frame() -> None:
    job = plan_job(load(JOBS / "lab8-exercise.toml"))
    text = (JOBS / "lab8-exercise.toml").read_text().replace("repeat = true", "repeat = false")
    ended = plan_job(loads(text.replace("hold_s = 5", "hold_s = 1"), job.file))
    robot = Robot(9600)
    summary, _ = driven(ended, Played(ended.trajectory), robot)
    assert summary.seconds == pytest.approx(6.02, abs=0.05)
    assert angle_of(robot.decoder.positions[0]) == pytest.approx(math.radians(120), abs=0.02)


def test_after_an_outage_the_whole_pose_is_sent_again_and_the_motion_goes_on_where_it_was() -> None:
    job = servos(4)
    robot = Robot(9600, faults=[(1.0, 2.3)])
    summary, log = driven(job, Limited(Played(job.trajectory), 2.0), robot)
    assert summary.outages == 1
    assert 2.3 <= summary.away_s < 2.3 + 0.6, "it looks every half second"
    assert [entry["event"] for entry in log if "event" in entry] == ["lost", "back"]
    assert robot.opened == 2
    before = [each for each in robot.arrived if each[0] < 1.0]
    after = [each for each in robot.arrived if each[0] > 3.3]
    assert [number for _, number, _ in after[:4]] == [0, 1, 2, 3]
    assert abs(after[0][2] - before[-1][2]) <= 6, "no jump: the motion stood still meanwhile"


def test_a_pose_that_was_torn_is_sent_whole_when_the_port_is_back() -> None:
    job = servos(4)
    robot = Robot(2400, faults=[(0.02, 1.0)])
    driven(job, Limited(Still(find_pose(job, "low")), 0.0), robot)
    assert [number for _, number, _ in robot.arrived] == [0, 1, 0, 1, 2, 3]


class TakenRobot(Robot):
    """Its port is back at once, but another program has it for as long as the line is away."""

    @contextmanager
    def open(self) -> Iterator[Robot]:
        if self._away():
            raise ToolError("port-busy", "is in use by another program", Location("/dev/robot"))
        with super().open() as opened:
            yield opened


def test_why_a_port_that_is_there_cannot_be_opened_is_in_the_log_once() -> None:
    """One that is missing needs no reason: that the line is lost says as much."""
    job = servos(1)
    motion = Limited(Played(job.trajectory), 2.0)
    _, missing = driven(job, motion, Robot(9600, faults=[(1.0, 2.3)]))
    _, taken = driven(job, motion, TakenRobot(9600, faults=[(1.0, 2.3)]))
    assert [entry["event"] for entry in missing if "event" in entry] == ["lost", "back"]
    events = [entry for entry in taken if "event" in entry]
    assert [entry["event"] for entry in events] == ["lost", "waiting", "back"]
    assert "/dev/robot: error: is in use by another program" in str(events[1]["text"])
    assert events[1]["s"] == pytest.approx(1.0, abs=0.1)


def test_a_port_that_stays_away_is_an_error_and_what_could_not_be_done_is_said() -> None:
    job = servos(1)
    robot = Robot(9600, faults=[(1.0, math.inf)])
    log: list[dict[str, object]] = []
    baud, controller = job_controller(job, 9600, RANGE, 0)
    line = SerialLink(robot.open, baud, robot.time(), 5.0)
    session = DriveSession(controller, line, robot.time(), log.append, find_pose(job, "s0=90"))
    with pytest.raises(ToolError, match="did not come back within 5 s: there is no such port"):
        session.run(Sine(1))
    assert not session.summary.stopped
    assert log[-1]["event"] == "not stopped"
    assert robot.now < 7


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_whatever_ends_a_drive_the_robot_is_stopped(error: type[BaseException]) -> None:
    job = servos(2)
    robot = Robot(2400)

    def interrupt() -> None:
        if robot.now > 1:
            robot.after_wait = lambda: None
            raise error

    robot.after_wait = interrupt
    baud, controller = job_controller(job, 2400, RANGE, 0)
    with SerialLink(robot.open, baud, robot.time(), 5.0) as line:
        session = DriveSession(
            controller, line, robot.time(), lambda entry: None, find_pose(job, "s0=90,s1=45")
        )
        with pytest.raises(error):
            session.run(Sine(2))
    assert session.summary.stopped
    last = robot.arrived[-2:]
    assert [number for _, number, _ in last] == [0, 1]
    assert [angle_of(position) for _, _, position in last] == pytest.approx(
        [math.pi / 2, math.pi / 4], abs=0.02
    )
    assert robot.now >= last[-1][0] - 1e-9, "the line is not closed before the last byte is out"


def test_orders_of_a_script_come_in_their_time_and_its_end_ends_the_drive() -> None:
    job = servos(1)
    robot = Robot(9600)
    orders: list[tuple[float, str]] = []
    words = script("one # comment\nwait 1\n\ntwo\nthree\nwait 0.5\n")
    summary, _ = driven(
        job,
        Still(find_pose(job, "low")),
        robot,
        source=words,
        on_command=lambda word: orders.append((robot.now, word)),
    )
    assert [word for _, word in orders] == ["one", "two", "three"]
    assert [moment for moment, _ in orders] == pytest.approx([0, 1, 1], abs=0.03)
    assert summary.seconds == pytest.approx(1.5, abs=0.05)


def test_an_order_that_is_none_stops_the_robot() -> None:
    job = servos(1)
    robot = Robot(9600)

    def refuse(word: str) -> None:
        raise InputError("unknown-command", f"'{word}' unknown command")

    with pytest.raises(InputError, match="unknown command"):
        driven(
            job,
            Still(find_pose(job, "low")),
            robot,
            source=script("jump"),
            on_command=refuse,
            stop=find_pose(job, "s0=60"),
        )
    assert angle_of(robot.decoder.positions[0]) == pytest.approx(math.radians(60), abs=0.02)


def test_positions_never_pass_a_servos_limits() -> None:
    job = plan_job(
        loads(
            (JOBS / "lab8-exercise.toml")
            .read_text()
            .replace("trim_us = 0", "min_deg = 1.3\nmax_deg = 178.1\ntrim_us = 7"),
            "job.toml",
        )
    )
    servo = job.servos[0]
    channel = ControllerChannel(servo, 0, WIDTHS)
    least, most = servo.widths_us
    for degrees in np.linspace(1.3, 178.1, 997).tolist():
        width = channel.widths_us[channel.position(math.radians(degrees))]
        assert least <= width <= most
        assert abs(width - servo.width_us(math.radians(degrees))) <= channel.step_us
    with pytest.raises(InputError, match="cannot go to 180°"):
        channel.position(math.pi)


def test_a_width_that_the_controller_cannot_make_is_refused_not_clamped() -> None:
    job = servos(1)
    channel = ControllerChannel(job.servos[0], 0, tuple(np.linspace(1200, 1800, 255).tolist()))
    assert channel.widths_us[channel.position(math.pi / 2)] == pytest.approx(1500, abs=2)
    with pytest.raises(
        InputError, match="would need pulses of 1000 µs: the controller produces 1200 to 1800"
    ):
        channel.position(0.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("9", "the job has no pose '9'"),
        ("high", "the job has no pose 'high'"),
        ("s0=ten", "'ten' is not an angle"),
        ("s7=10", "there is no servo 's7'"),
        ("s0=200", "cannot go to 200°"),
    ],
)
def test_a_pose_that_is_not_there_is_refused(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        find_pose(servos(2), text)


def test_a_way_to_the_first_pose_longer_than_a_group_counts_is_refused_and_not_shortened() -> None:
    """The time of a group is one byte of frames, 254 at most: 2.54 s of 10 ms each."""
    controller = ServoController((), frame_s=0.01)
    time = VirtualTime().time()
    with SerialLink(lambda: nullcontext(NullWire()), 2400, time, 0.0) as line:
        DriveSession(controller, line, time, lambda entry: None, arrive_s=2.54)
        with pytest.raises(
            InputError, match=r"--arrive-s: 2\.55 s to the first pose are 255 frames"
        ) as found:
            DriveSession(controller, line, time, lambda entry: None, arrive_s=2.55)
    assert found.value.hint == "the stream engine counts up to 254 frames, 2.54 s"
