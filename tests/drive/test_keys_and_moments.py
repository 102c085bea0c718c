"""A drive in a time that only a test advances: every key, moment and position by hand."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from servogen.drive import commands as c
from servogen.drive.controller import ControllerChannel, ServoController, job_controller
from servogen.drive.motions import Limited, Played, Still, find_pose, frame_at
from servogen.drive.on_command import CommandedFrame, line_baud
from servogen.drive.serial_link import SerialLink, VirtualTime
from servogen.drive.session import DriveSession, Summary
from servogen.drive.steering import BaseController, Jog, PoseController, Rates, job_steering
from servogen.errors import InputError
from servogen.job import PlannedJob, loads, plan_job
from servogen.motion.trajectory import JointTrajectory
from servogen.units import Clock, Cycles

HEAD = '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'


@cache
def arms(stream: str = "") -> PlannedJob:
    """Two servos: 0° 1000 µs, 180° 2000 µs; they turn at 1.8 rad/s."""
    text = HEAD
    for index, name in enumerate(("one", "two")):
        text += f'[[servo]]\nname = "{name}"\npin = "RB{index}"\nmodel = "futaba-s3001"\n'
    text += (
        '[motion]\nposes = [ { name = "low", one_deg = 30, two_deg = 60, hold_s = 0.1 },'
        " { one_deg = 120, two_deg = 90, hold_s = 0.1 } ]\n"
    )
    return plan_job(loads(text + stream, "job.toml"))


@cache
def wheels() -> PlannedJob:
    text = HEAD + '[robot]\nname = "omni"\n'
    for index in (1, 2, 3):
        text += f'[[servo]]\nname = "w{index}"\npin = "RB{index}"\nmodel = "continuous"\n'
    text += '[drive]\nwheels = ["w1", "w2", "w3"]\ncorners_mm = [[0, 0], [200, 0]]\nspeed_mm_s = 50\n'
    return plan_job(loads(text, "job.toml"))


# ---- commands -------------------------------------------------------------------------------------------

# docs/drive.md, and for the arrows ECMA-48: CUU, CUD, CUF, CUB end in A, B, C, D.
KEYS = [
    *((key, "forward") for key in (b"w", b"\x1b[A", b"\x1bOA")),
    *((key, "back") for key in (b"s", b"\x1b[B", b"\x1bOB")),
    *((key, "right") for key in (b"d", b"\x1b[C", b"\x1bOC")),
    *((key, "left") for key in (b"a", b"\x1b[D", b"\x1bOD")),
    (b"q", "sideways-left"),
    (b"e", "sideways-right"),
    (b" ", "stop"),
    *((key, "quit") for key in (b"x", b"\x04")),
    (b"\t", "next"),
    (b"\x1b[Z", "previous"),
    *((key, "+") for key in (b"+", b"=")),
    (b"-", "-"),
    (b"[", "finer"),
    (b"]", "coarser"),
    *((b"%d" % digit, str(digit)) for digit in range(1, 10)),
]


def test_each_key_is_its_command_among_others_too() -> None:
    for key, command in KEYS:
        assert c.commands_of_keys(key) == [command]
        assert c.commands_of_keys(b"w" + key + b"s") == ["forward", command, "back"]


def test_no_other_key_is_a_command() -> None:
    known = {key for key, _ in KEYS if len(key) == 1}
    others = bytes(code for code in range(256) if bytes([code]) not in known)
    assert c.commands_of_keys(others.replace(b"\x1b", b"")) == []
    assert c.commands_of_keys(b"0\x1b") == []
    assert sum(len(keys) for keys in c.KEYS.values()) == len(KEYS)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (b"wsad ", ["forward", "back", "left", "right", "stop"]),
        (b"\x1b[A\x1bOB\t", ["forward", "back", "next"]),
        (b"q", ["quit"]),
        (b"x\x04", ["quit", "quit"]),
        (b"e19[]+-", []),
    ],
)
def test_a_walk_on_command_has_the_keys_of_its_directions(keys: bytes, expected: list[str]) -> None:
    assert c.commands_of_keys(keys, c.WALK_KEYS) == expected


@pytest.mark.parametrize(("text", "seconds"), [("wait 0", 0), ("wait 1.5", 1.5), ("wait  1e3", 1000)])
def test_a_wait_states_its_seconds(text: str, seconds: float) -> None:
    assert c.wait_seconds(text) == seconds


@pytest.mark.parametrize("text", ["wait", "wait x", "wait -0.1", "wait inf", "wait nan", "wait 1 2"])
def test_a_wait_of_no_time_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=f"'{text}' does not state how long to wait"):
        c.wait_seconds(text)


def test_a_script_gives_each_command_when_its_time_has_come_and_ends() -> None:
    source = c.script("one\nwait 2 # s\n\n# nothing\ntwo\nwait 1\nthree")
    assert source.since(10.0) == ["one"]
    assert source.since(11.999) == []
    assert source.since(12.0) == ["two"]
    assert source.since(12.9) == []
    assert source.since(13.5) == ["three", "quit"]
    assert source.since(99.0) == []
    assert c.NoCommands().since(1.0) == []


@pytest.fixture
def pipe() -> Iterator[tuple[int, Callable[[bytes], object], Callable[[], None]]]:
    """A reading end, and functions that write to the other one and close it."""
    reading, writing = os.pipe()
    open_ends = {reading, writing}

    def close() -> None:
        open_ends.discard(writing)
        os.close(writing)

    yield reading, lambda data: os.write(writing, data), close
    for end in open_ends:
        os.close(end)


def test_lines_of_a_pipe_are_commands_once_they_are_whole(pipe: tuple[int, Callable, Callable]) -> None:
    reading, write, close = pipe
    source = c.LineCommands(reading)
    assert source.since(0.0) == []
    write(b"forw")
    assert source.since(0.0) == []
    write(b"ard\nback\nst")
    assert source.since(0.0) == ["forward", "back"]
    write(b"op")
    close()
    assert source.since(0.0) == ["stop", "quit"]
    assert source.since(0.0) == []


def test_keys_of_a_pipe_are_commands_and_its_end_is_quit(pipe: tuple[int, Callable, Callable]) -> None:
    reading, write, close = pipe
    source = c.KeyCommands(reading)
    assert source.since(0.0) == []
    write(b"w1")
    assert source.since(0.0) == ["forward", "1"]
    write(b"a")
    close()
    assert source.since(0.0) == ["left", "quit"]


# ---- motions --------------------------------------------------------------------------------------------


def played(loop_start: int) -> Played:
    """Five frames of 20 ms with the angles 0 to 4."""
    angles = np.arange(5.0)[:, None]
    return Played(JointTrajectory(("a",), Clock(4_000_000), Cycles(20_000), angles, loop_start))


@pytest.mark.parametrize(
    ("loop_start", "angles"),
    [
        (0, [0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1]),
        (2, [0, 1, 2, 3, 4, 2, 3, 4, 2, 3, 4, 2]),
        (3, [0, 1, 2, 3, 4, 3, 4, 3, 4, 3, 4, 3]),
        (4, [0, 1, 2, 3, 4, 4, None, None, None, None, None, None]),
    ],
)
def test_frames_are_played_once_and_then_the_loop(loop_start: int, angles: list[float | None]) -> None:
    motion = played(loop_start)
    for frame, expected in enumerate(angles):
        found = motion.at(frame * 0.02 + 0.001)
        assert (None if found is None else found.tolist()) == (None if expected is None else [expected])


def test_a_moment_belongs_to_the_frame_that_has_begun() -> None:
    trajectory = played(0).trajectory
    assert [frame_at(trajectory, seconds) for seconds in (0.0, 0.0199, 0.02, 0.06, 0.3 - 1e-12, 0.3)] == [
        *(0, 0, 1, 3, 15, 15)
    ]
    # a frame begins up to a millionth of a frame early
    assert frame_at(trajectory, 0.02 * (1 - 0.9e-6)) == 1
    assert frame_at(trajectory, 0.02 * (1 - 1.1e-6)) == 0


def test_a_limited_motion_is_over_after_its_time() -> None:
    motion = Limited(Still(np.array([1.0])), 2.0)
    assert motion.at(2.0) is not None
    assert motion.at(2.0 + 1e-9) is None


def test_a_pose_is_one_of_the_job_s_or_angles_of_servos() -> None:
    job = arms()
    assert np.degrees(find_pose(job, "2")).tolist() == pytest.approx([120, 90])
    assert np.degrees(find_pose(job, "low")).tolist() == pytest.approx([30, 60])
    assert np.degrees(find_pose(job, " two = 45 , one=180")).tolist() == pytest.approx([180, 45])
    for text in ("0", "3", "-1", "²", "1.0"):
        with pytest.raises(InputError, match=f"the job has no pose '{text}'") as caught:
            find_pose(job, text)
        assert caught.value.hint == "1 to 2, or a name"


def test_a_job_without_poses_has_angles_only() -> None:
    with pytest.raises(InputError, match="the job has no poses") as caught:
        find_pose(wheels(), "1")
    assert caught.value.hint == "state angles: --pose arm=90,hand=45"
    assert np.degrees(find_pose(wheels(), "w2=90"))[1] == pytest.approx(90)


# ---- steering -------------------------------------------------------------------------------------------


def test_all_servos_arrive_together_when_the_slowest_can() -> None:
    """From 90° both; `one` goes 90° at 1.8 rad/s, `two` 30°."""
    controller = PoseController(arms())
    assert np.degrees(controller.at(1.0)).tolist() == [90, 90]
    controller.command("one=180,two=60")
    takes = math.radians(90) / 1.8
    for share in (0.0, 0.25, 0.5, 1.0, 2.0):
        angles = np.degrees(controller.at(1.0 + share * takes))
        done = min(share, 1.0)
        assert angles.tolist() == pytest.approx([90 + 90 * done, 90 - 30 * done])
    assert np.degrees(controller.goal).tolist() == pytest.approx([180, 60])


def test_a_new_pose_begins_where_the_servos_are_and_leaves_out_those_it_does_not_name() -> None:
    controller = PoseController(arms())
    controller.at(0.0)
    controller.command("one=180,two=60")
    takes = math.radians(90) / 1.8
    controller.at(takes / 2)  # 135°, 75°
    controller.command("one=90")
    now = np.degrees(controller.at(takes / 2))
    assert now.tolist() == pytest.approx([135, 75])
    half = np.degrees(controller.at(takes / 2 + takes / 4))
    assert half.tolist() == pytest.approx([112.5, 67.5])
    assert np.degrees(controller.at(9.0)).tolist() == pytest.approx([90, 60])


def test_stop_keeps_the_servos_where_they_are() -> None:
    controller = PoseController(arms())
    controller.at(0.0)
    controller.command("2")
    there = np.degrees(controller.at(0.2))
    controller.command("stop")
    assert np.degrees(controller.at(0.3)).tolist() == there.tolist()
    assert np.degrees(controller.goal).tolist() == there.tolist()
    assert controller.commands == ("1", "2", "low", "stop")
    with pytest.raises(InputError, match="unknown command 'hop'"):
        controller.command("hop")


def test_a_servo_without_a_speed_turns_a_radian_in_a_second() -> None:
    model = replace(arms().servos[0].model, speed=None)
    job = replace(arms(), servos=tuple(replace(servo, model=model) for servo in arms().servos))
    controller = PoseController(job)
    controller.at(0.0)
    controller.command(f"one={math.degrees(math.pi / 2 + 0.5):.9f}")
    assert controller.at(0.25)[0] == pytest.approx(math.pi / 2 + 0.25)


STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10]
"""docs/drive.md."""


def test_the_step_of_a_jog_goes_through_all_of_the_documentation_and_stays_at_its_ends() -> None:
    jog = Jog(arms(), PoseController(arms()))
    seen = [jog.state().rpartition("step ")[2]]
    for command in ["coarser"] * 4 + ["finer"] * 8:
        jog.command(command)
        seen.append(jog.state().rpartition("step ")[2])
    sizes = [1, 2, 5, 10, 10, *STEPS[-2::-1], 0.1, 0.1]
    assert seen == [f"{size:g}°" for size in sizes]


@pytest.mark.parametrize(("count", "size"), list(enumerate([10, 5, 2, 1, 0.5, 0.2, 0.1])))
def test_a_step_moves_the_goal_by_its_size(count: int, size: float) -> None:
    jog = Jog(arms(), PoseController(arms()))
    for command in ["coarser"] * 3 + ["finer"] * count + ["two", "+", "+", "-"]:
        jog.command(command)
    assert np.degrees(jog.poser.goal).tolist() == pytest.approx([90, 90 + size])
    names = [jog.state().split(":")[0]]
    for command in ("next", "next", "previous", "previous"):
        jog.command(command)
        names.append(jog.state().split(":")[0])
    assert names == ["two", "one", "two", "one", "two"]
    assert jog.commands == (
        *("1", "2", "low", "stop", "one", "two", "next", "previous", "+", "-", "finer", "coarser"),
    )


def test_a_base_changes_its_speed_in_a_fifth_of_a_second() -> None:
    base = BaseController({"go": np.array([1.0, -2.0]), "stop": np.zeros(2)})
    assert base.at(5.0).tolist() == [0, 0]
    base.command("go")
    for late, share in ((0.0, 0.0), (0.05, 0.25), (0.1, 0.5), (0.2, 1.0), (3.0, 1.0)):
        assert base.at(5.0 + late).tolist() == pytest.approx([share, -2 * share])
    base.command("stop")
    base.at(8.1)
    base.command("go")  # from half of its speed
    assert base.at(8.2).tolist() == pytest.approx([0.75, -1.5])
    assert base.commands == ("go", "stop")
    with pytest.raises(InputError, match="unknown command 'jump'"):
        base.command("jump")


# The wheels' speeds of the six directions by the kinematics of docs/omni.md; 45°/s if nothing else is asked.
@pytest.mark.parametrize(
    ("rates", "speed", "turn"),
    [(Rates(), 0.05, 45.0), (Rates(distance_mm=30.0), 0.03, 45.0), (Rates(turn_deg=10.0), 0.05, 10.0)],
)
def test_a_base_rolls_at_the_speed_of_its_job_or_the_one_asked(
    rates: Rates, speed: float, turn: float
) -> None:
    job = wheels()
    controller = job_steering(job, rates)
    assert isinstance(controller, BaseController)
    base = job.base
    assert base is not None
    ways = {
        "forward": (speed, 0, 0),
        "back": (-speed, 0, 0),
        "left": (0, 0, math.radians(turn)),
        "right": (0, 0, -math.radians(turn)),
        "sideways-left": (0, speed, 0),
        "sideways-right": (0, -speed, 0),
        "stop": (0, 0, 0),
    }
    assert set(controller.commands) == set(ways)
    for command, way in ways.items():
        assert base.body_speed(controller.speeds[command]) == pytest.approx(np.array(way), abs=1e-12)


def test_a_base_that_cannot_turn_so_fast_rolls_only_and_one_that_can_do_nothing_is_refused() -> None:
    commands = job_steering(wheels(), Rates(turn_deg=3600.0)).commands
    assert commands == ("forward", "back", "sideways-left", "sideways-right", "stop")
    with pytest.raises(InputError, match="cannot turn at"):
        job_steering(wheels(), Rates(distance_mm=1e5, turn_deg=3600.0))


# ---- the controller -------------------------------------------------------------------------------------


def test_the_positions_of_a_controller_are_evenly_spaced_between_its_widths() -> None:
    baud, controller = job_controller(arms(), None, "500,2500", 3)
    assert baud == 9600
    assert [channel.number for channel in controller.channels] == [3, 4]
    first = controller.channels[0]
    assert first.widths_us == pytest.approx([500 + 2000 * position / 254 for position in range(255)])
    assert first.step_us == pytest.approx(2000 / 254)
    assert (controller.frame_s, controller.refresh_s) == (None, 0.5)
    assert job_controller(arms(), 2400, "500,2500", 0)[0] == 2400


@pytest.mark.parametrize(
    ("text", "fits"), [("0,1", False), ("0.1,1", True), ("2,2", False), ("1,inf", False)]
)
def test_a_range_rises_from_above_zero(text: str, fits: bool) -> None:
    if fits:
        assert job_controller(arms(), None, text, 0)[1].channels[0].widths_us[-1] == 1
    else:
        with pytest.raises(InputError, match=f"'{text}' is not a range of widths"):
            job_controller(arms(), None, text, 0)


def test_the_numbers_of_servos_end_at_254() -> None:
    assert [each.number for each in job_controller(arms(), None, "500,2500", 253)[1].channels] == [253, 254]
    with pytest.raises(InputError, match="2 servos numbered from 254: the highest number is 254"):
        job_controller(arms(), None, "500,2500", 254)


def test_a_job_with_a_stream_is_its_own_controller() -> None:
    """Positions are whole cycles from 1000 to 2000 µs; four are sent in the silence that it allows."""
    for silence, refresh in (("1.2", 0.3), ("9", 0.5)):
        job = arms(f"[stream]\nbaud = 1200\nsilence_s = {silence}\n")
        baud, controller = job_controller(job, None, None, 0)
        assert (baud, controller.frame_s) == (1200, pytest.approx(0.02))
        assert controller.refresh_s == pytest.approx(refresh)
        channel = controller.channels[0]
        assert (channel.widths_us[0], channel.widths_us[254]) == (1000, 2000)
        assert set(np.diff(channel.widths_us).tolist()) <= {3.0, 4.0}  # 1000/254 is 3.94 cycles of 1 µs
        assert channel.slack_us == pytest.approx(0.5 + 1e-6)
    with pytest.raises(InputError, match="the stream engine's servos are numbered from 0"):
        job_controller(job, None, None, 1)
    assert job_controller(job, None, "500,2500", 1)[1].channels[0].number == 1


def uneven(limits: tuple[float, float] = (1000.0, 1030.0)) -> ControllerChannel:
    """Positions of 1000, 1010, 1022, 1030 µs; the others are longer than the servo's limits."""
    servo = arms().servos[0]
    low, high = ((width - 1000) / 1000 * math.pi for width in limits)
    rest = tuple(3000.0 + index for index in range(251))
    return ControllerChannel(replace(servo, limits=(low, high)), 0, (1000.0, 1010.0, 1022.0, 1030.0, *rest))


@pytest.mark.parametrize(
    ("width", "position"),
    [(1000, 0), (1004.9, 0), (1005.1, 1), (1015.9, 1), (1016.1, 2), (1026.1, 3), (1030, 3)],
)
def test_the_nearest_position_is_taken_of_uneven_ones_too(width: float, position: int) -> None:
    assert uneven().position((width - 1000) / 1000 * math.pi) == position


def test_a_position_beyond_the_limits_is_not_taken_although_it_is_nearer() -> None:
    channel = uneven((1003.0, 1029.0))
    assert channel.position(0.0035 * math.pi) == 1
    assert channel.position(0.0285 * math.pi) == 2


def test_only_positions_that_differ_are_changes() -> None:
    channel = uneven()
    controller = ServoController((channel, replace(channel, number=7)))
    angles = np.array([0.010 * math.pi, math.nan])
    assert controller.changes([None, None], angles) == [(0, 1)]
    assert controller.changes([1, 2], angles) == []
    assert controller.changes([0, 2], np.full(2, 0.010 * math.pi)) == [(0, 1), (1, 1)]
    assert controller.command(1, 254) == bytes([255, 7, 254])


# ---- line, session and sweep ----------------------------------------------------------------------------


class Wire:
    """Records what is written and when."""

    def __init__(self, clock: VirtualTime) -> None:
        self.clock = clock
        self.written: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        self.written.append((round(self.clock.at, 6), data))


@contextmanager
def linked(baud: int = 2400) -> Iterator[tuple[VirtualTime, Wire, SerialLink]]:
    clock = VirtualTime()
    wire = Wire(clock)
    with SerialLink(lambda: nullcontext(wire), baud, clock.time(), 10.0) as line:
        yield clock, wire, line


def test_the_poses_per_second_are_those_of_the_time_in_motion() -> None:
    assert Summary(seconds=9.0, moving_s=4.0, rounds=10).poses_per_second == 2.5
    assert Summary(rounds=10).poses_per_second == 0.0
    assert Summary(moving_s=2.0, rounds=1).to_json()["poses_per_second"] == 0.5


def test_a_stream_engine_goes_to_the_first_pose_as_a_group_and_hears_from_its_line_meanwhile() -> None:
    job = arms("[stream]\nsilence_s = 1.2\n")
    baud, controller = job_controller(job, None, None, 0)
    log: list[dict[str, object]] = []
    with linked(baud) as (clock, wire, line):
        session = DriveSession(controller, line, clock.time(), log.append, arrive_s=0.5)
        summary = session.run(Limited(Still(find_pose(job, "low")), 0.0))
    # group begins, two positions, 25 frames of 20 ms; then a byte triple each 0.3 s until they are over
    sent = [data for _, data in wire.written]
    assert sent[1:3] == [bytes([255, 0, 42]), bytes([255, 1, 85])]  # 30° and 60° of 180°
    assert len(sent) == 6
    assert sent[4] == sent[5]
    goes = wire.written[3][0] + 0.0125
    assert [moment for moment, _ in wire.written[4:]] == pytest.approx(
        [wire.written[3][0] + 0.3, goes + 0.5], abs=1e-5
    )
    assert (summary.rounds, summary.commands, summary.stopped) == (1, 2, False)
    # it is held for the one interval of 5 ms in which the motion is found to be over
    assert summary.moving_s == pytest.approx(0.005)
    assert summary.seconds == pytest.approx(goes + 0.5 + 0.0125 + 0.005)
    assert log[3]["frames"] == 25


def test_the_facts_of_each_command_are_logged() -> None:
    job = arms()
    _, controller = job_controller(job, None, "500,2500", 5)
    log: list[dict[str, object]] = []
    with linked(9600) as (clock, _, line):
        session = DriveSession(controller, line, clock.time(), log.append, stop=find_pose(job, "two=90"))
        summary = session.run(Limited(Still(find_pose(job, "one=90")), 0.1))
    assert log[0] == {
        "s": round(30 / 9600, 4),
        "servo": "one",
        "number": 5,
        "position": 127,
        "width_us": 1500.0,
        "bytes": "ff 05 7f",
    }
    assert [entry.get("number") for entry in log] == [5, 6, None]
    assert log[-1]["event"] == "stopped"
    assert (summary.stopped, summary.commands, summary.rounds, summary.outages) == (True, 2, 1, 0)


# ---- a walk on command ----------------------------------------------------------------------------------


def test_a_bit_of_a_commanded_walk_s_line_lasts_a_frame() -> None:
    assert line_baud(arms()) == 50
    assert line_baud(plan_job(loads(_with_frames("15_000"), "job.toml"))) == 67  # 66.67


def _with_frames(period: str) -> str:
    servo = '[[servo]]\nname = "a"\npin = "RB0"\nmodel = "futaba-s3001"\n'
    return f"{HEAD}{servo}[motion]\nposes = [{{ a_deg = 9, hold_s = 1 }}]\n[frame]\nperiod_us = {period}\n"


def test_the_state_of_a_commanded_walk_is_shown_in_one_line() -> None:
    frame = CommandedFrame(1.23456, 61, "forward", "cycle", {"a": 1499.6, "b": 900.0})
    assert frame.text() == "    1.23 s  frame    61  forward cycle   1500 900 µs"
    assert frame.to_json() == {
        "s": 1.235,
        "frame": 61,
        "direction": "forward",
        "part": "cycle",
        "widths_us": {"a": 1499.6, "b": 900.0},
    }
