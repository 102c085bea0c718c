"""Orders become motion: walking robots, bases, poses."""

import math
import os
import pty
import re
import termios
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from servogen.drive import steering as module
from servogen.drive.commands import KeyCommands, LineCommands, commands_in, terminal_keys
from servogen.drive.steering import Rates, Steering, WalkController, job_steering
from servogen.errors import InputError, ToolError
from servogen.job import PlannedJob, load, loads, plan_job
from servogen.motion.trajectory import Floats
from tests.drive.conftest import planned

JOBS = Path(__file__).parents[2] / "jobs"
FRAME_S = 0.02


def steered(steering: Steering, orders: dict[int, str], frames: int) -> Floats:
    """Degrees, a row a frame; `orders` by the frame in which they come."""
    rows = []
    for frame in range(frames):
        if frame in orders:
            steering.command(orders[frame])
        rows.append(steering.at(frame * FRAME_S))
    return np.asarray(np.degrees(np.array(rows)))


@cache
def _ways() -> WalkController:
    return steered_walk(planned("hexapod-tripod"), Rates())


def walking() -> WalkController:
    """The hexapod's controller, which stands; its ways are planned once."""
    return WalkController(_ways().job, _ways().gaits)


def steered_walk(job: PlannedJob, rates: Rates) -> WalkController:
    steering = job_steering(job, rates)
    assert isinstance(steering, WalkController)
    return steering


def test_a_walk_is_steered_without_its_job_file(tmp_path: Path) -> None:
    """The ways are planned from the job that was loaded: the file may have changed, or gone, since."""
    file = tmp_path / "hexapod.toml"
    file.write_text((JOBS / "hexapod-tripod.toml").read_text())
    job = plan_job(load(file))
    file.unlink()
    robot = steered_walk(job, Rates())
    assert robot.commands == walking().commands
    assert (robot.gaits["left"].cycle == walking().gaits["left"].cycle).all()


@pytest.mark.campaign
def test_whatever_is_ordered_no_joint_of_the_walk_jumps() -> None:
    """β lifts as in the walk ahead. α is fastest in the step on the spot to the footfalls of a turn: a corner
    leg at (90, 50) mm turns in a swing of 24 frames from straight out to the line from the body's centre, and
    on to where the stance begins or ends: half of the 4° that the body turns in a stance away, seen from an
    axis at 102.956 mm, on a circle of 60 mm about it. A step on the spot has the law s' = 30 u² (1 - u)²: at
    most 1.875 ways in the time of a swing.
    """
    centre, radius, half = math.hypot(90, 50), 60.0, math.radians(2)
    out = centre + radius
    beyond = math.atan2(out * math.sin(half), out * math.cos(half) - centre)
    job = planned("hexapod-tripod")
    most = np.abs(np.diff(np.degrees(job.trajectory.angles), axis=0)).max(axis=0)
    most[0::2] = math.degrees(math.atan2(90, 50) + beyond) * 1.875 / 24
    random = np.random.default_rng(7)
    robot = walking()
    orders = {int(at): str(random.choice(robot.commands)) for at in random.integers(0, 3000, 60)}
    found = np.abs(np.diff(steered(robot, orders, 3200), axis=0)).max(axis=0)
    assert (found[1::2] <= 1.01 * most[1::2]).all()
    assert (found[0::2] <= most[0::2]).all()
    assert found[0::2].max() > 0.99 * most[0], "the corner legs stepped on the spot"


def test_a_way_is_start_cycles_and_stop_and_ends_standing() -> None:
    robot = walking()
    gait = robot.gaits["forward"]
    rows = steered(robot, {10: "forward", 200: "stop"}, 500)
    begin = 10
    first = np.degrees(np.concatenate((gait.start, gait.cycle, gait.cycle)))
    assert np.allclose(rows[begin : begin + len(first)], first)
    assert np.allclose(rows[-1], np.degrees(gait.stop[-1]))
    assert np.allclose(rows[-100:], rows[-1]), "it stands"
    assert robot.walking is None


def test_the_steered_walk_is_the_walk_that_a_job_plans() -> None:
    """At the full height: lower, a steered leg may stand with the other sign of β because of the turns.

    Without compensation of lost motion: with it, the turns' swings decide how far all swings overshoot.
    """
    text = re.sub("body_height_mm = 130.*", "compensate = false", (JOBS / "hexapod-tripod.toml").read_text())
    job = plan_job(loads(text, "job.toml"))
    gait = steered_walk(job, Rates()).gaits["forward"]
    walk = job.trajectory.angles  # four cycles of 40 mm, from standing to standing
    mine = np.concatenate((gait.start, *[gait.cycle] * 3, gait.stop))
    assert np.allclose(mine[: len(walk)], walk[: len(mine)], atol=1e-6)


def test_all_ways_start_and_stop_standing_alike_below_the_full_height_too() -> None:
    """β keeps its sign in every leg: to change it a foot would have to pass through the ground."""
    gaits = walking().gaits
    stands = gaits["forward"].start[0]
    for gait in gaits.values():
        assert np.allclose(gait.start[0], stands)
        assert np.allclose(gait.stop[-1], stands)
        rows = np.degrees(np.concatenate((gait.start, gait.cycle, gait.stop)))
        lifts = rows[:, 1::2] - 90
        assert (np.sign(lifts) == np.sign(lifts[0])).all()
        assert np.abs(lifts).min() > 33  # cos β = 50 / 60


def test_a_source_is_asked_without_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[object, ...]] = []

    def nothing(*arguments: object) -> tuple[list[int], list[int], list[int]]:
        asked.append(arguments)
        return [], [], []

    monkeypatch.setattr("select.select", nothing)
    assert LineCommands(7).since(0.0) == []
    assert asked == [([7], (), (), 0)]


def test_without_posix_no_source_can_be_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.name", "nt")
    for source in (LineCommands(7), KeyCommands(7)):
        with pytest.raises(ToolError, match="a terminal or pipe that can be polled"):
            source.since(0.0)


def cut(monkeypatch: pytest.MonkeyPatch, wrong: float, steady: float, stop: int = 2) -> list[float | None]:
    """The cycles that are planned for a way of a start 0 1 2 3, a cycle 4 5 6 and a stop 7 0.

    Walks of fewer than `steady` cycles are `wrong` radians off in their last frame before the stop.
    """
    asked: list[float | None] = []

    def walk(job: object, row: dict[str, float], others: object) -> SimpleNamespace:
        cycles = row.get("cycles")
        asked.append(cycles)
        angles = np.arange(7.0)
        if cycles is not None:
            angles = np.append(angles, [7.0, 0.0][:stop])
            angles[6] += wrong if cycles < steady else 1e-7
        return SimpleNamespace(trajectory=SimpleNamespace(angles=angles[:, None], loop_start=4))

    monkeypatch.setattr(module, "plan_job", walk)
    found = module.gait_frames(SimpleNamespace(file="a.toml"), {"forward_mm": 1.0}, ())  # type: ignore[arg-type]
    parts = (found.start, found.cycle, found.stop)
    assert [part[:, 0].tolist() for part in parts] == [[0, 1, 2, 3], [4, 5, 6], [7, 0]]
    return asked


def test_a_way_is_cut_out_of_the_first_walk_that_begins_as_the_endless_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The start is longer than a cycle, so no walk of fewer than three has a start, a cycle and a stop."""
    assert cut(monkeypatch, 1e-3, 0.0) == [None, 3.0]
    assert cut(monkeypatch, 1e-3, 5.0) == [None, 3.0, 4.0, 5.0]
    assert cut(monkeypatch, -0.5, 11.0)[-1] == 11.0
    for steady, stop in ((12.0, 2), (0.0, 0)):
        with pytest.raises(InputError, match="the walk cannot be stopped: its gait leaves a leg behind"):
            cut(monkeypatch, 1e-3, steady, stop)


def test_a_stride_that_the_legs_cannot_do_is_refused() -> None:
    with pytest.raises(InputError, match="limits"):
        steered_walk(planned("hexapod-tripod"), Rates(400, 200))


def test_a_stream_job_without_poses_takes_angles() -> None:
    steering = job_steering(planned("stream-arm"), Rates())
    assert steered(steering, {0: "base=120,grip=60"}, 100)[-1] == pytest.approx([120, 90, 60])


def test_an_unknown_order_is_refused() -> None:
    with pytest.raises(InputError, match="unknown command"):
        walking().command("jump")


def test_an_arm_program_has_nothing_to_steer() -> None:
    with pytest.raises(InputError, match="nothing can be steered"):
        job_steering(planned("rvm1-program"), Rates())


def test_a_terminals_keys_come_without_return_and_it_is_as_before_afterwards() -> None:
    master, slave = pty.openpty()
    try:
        before = termios.tcgetattr(slave)
        with terminal_keys(slave) as opened:
            assert opened.since(0.0) == []
            os.write(master, b"a\x1b[D")
            assert opened.since(0.0) == ["left", "left"]
            assert not termios.tcgetattr(slave)[3] & (termios.ECHO | termios.ICANON)
        assert termios.tcgetattr(slave) == before
    finally:
        os.close(master)
        os.close(slave)


def test_comments_and_empty_lines_are_no_orders() -> None:
    assert commands_in("a # b\n\n  \n#c\nd") == ["a", "d"]
