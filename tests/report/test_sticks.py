"""Stick figures and scenes: what films show."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.job import load, plan_job
from servogen.kinematics.catalogue import arm, names, robot
from servogen.kinematics.forward import fk_position
from servogen.kinematics.leg import Leg
from servogen.kinematics.omni import OmniBase
from servogen.report.film import MAX_PICTURES, FilmPart, FilmScene, film, job_scene
from servogen.report.sticks import base_outline, stick
from servogen.robot.model import Arm, FixedFrame

JOBS = Path(__file__).parents[2] / "jobs"
ARMS = [name for name in names() if isinstance(robot(name), Arm)]
TURNING = [name for name in ARMS if all(joint.turning for joint in arm(name).joints)]


def somewhere(found: Arm) -> np.ndarray:
    low, high = (np.array([getattr(joint, end) for joint in found.joints]) for end in ("lower", "upper"))
    return low + np.array([[0.2], [0.5], [0.7]]) * (high - low)


@pytest.mark.parametrize("name", ARMS)
def test_a_stick_figure_ends_where_the_tool_is(name: str) -> None:
    found = arm(name)
    joints = somewhere(found)
    assert stick(found, joints)[:, -1] == pytest.approx(fk_position(found, joints), abs=1e-12)


def test_a_stick_figure_ends_at_the_tip_of_what_the_hand_holds() -> None:
    """A pen of 80 mm along the approach axis, which is a part of the figure."""
    found = arm("rv-m1").with_tool(FixedFrame(z=0.08))
    joints = somewhere(found)
    corners = stick(found, joints)
    assert corners[:, -1] == pytest.approx(fk_position(found, joints), abs=1e-12)
    assert np.linalg.norm(corners[:, -1] - corners[:, -2], axis=1) == pytest.approx([0.08] * 3)


@pytest.mark.parametrize("name", TURNING)
def test_a_link_between_two_joints_that_turn_keeps_its_length(name: str) -> None:
    """A DH row shifts along z by d and along x by a: the corner between them divides the link so."""
    found = arm(name)
    corners = stick(found, somewhere(found))
    lengths = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    assert lengths == pytest.approx(np.tile(lengths[:1], (3, 1)), abs=1e-12)


def test_the_legs_parts_have_its_lengths() -> None:
    found = arm("leg")
    leg = Leg.of(found.length)
    lengths = np.linalg.norm(np.diff(stick(found, somewhere(found)), axis=1), axis=2)
    assert lengths == pytest.approx(np.tile([leg.ab, leg.bc, leg.cd, leg.df], (3, 1)))


def test_the_wheels_of_the_base_are_at_60_300_and_180_degrees() -> None:
    base = robot("omni")
    assert isinstance(base, OmniBase)
    _, _, *wheels = base_outline(base, np.zeros((1, 3)))
    middles = [wheel[0].mean(axis=0) for wheel in wheels]
    angles = [round(float(np.degrees(np.arctan2(y, x))) % 360) for x, y, _ in middles]
    assert angles == [60, 300, 180]
    assert np.linalg.norm(middles, axis=1) == pytest.approx(base.wheel_distance)


def test_the_base_is_drawn_where_it_is_and_turned_as_it_is() -> None:
    """The line to its front points along x; at 90° it points along y, from wherever the base is."""
    base = robot("omni")
    assert isinstance(base, OmniBase)
    poses = np.array([[0.2, -0.1, np.pi / 2], [0.3, 0.4, np.pi]])
    rim, front, *_ = base_outline(base, poses)
    reach = 0.8 * base.wheel_distance
    assert front[0] == pytest.approx(np.array([[0.2, -0.1, 0], [0.2, -0.1 + reach, 0]]))
    assert front[1] == pytest.approx(np.array([[0.3, 0.4, 0], [0.3 - reach, 0.4, 0]]))
    assert np.hypot(*(rim[1, :, :2] - [0.3, 0.4]).T) == pytest.approx(base.wheel_distance)


@pytest.mark.parametrize(
    ("frames", "pictures", "shown_s"), [(100, 100, 0.02), (101, 51, 0.04), (200, 100, 0.04), (201, 67, 0.06)]
)
def test_of_a_long_motion_every_second_or_third_frame_is_shown(
    frames: int, pictures: int, shown_s: float
) -> None:
    """At most 100 pictures, which last as long as the frames that they stand for."""
    job = plan_job(load(JOBS / "lab9-exercise.toml"))
    angles = np.repeat(job.trajectory.angles[:1], frames, axis=0)
    scene = job_scene(replace(job, trajectory=replace(job.trajectory, angles=angles, loop_start=0)))
    assert (scene.count, scene.picture_s) == (pictures, pytest.approx(shown_s))


@pytest.mark.parametrize(
    "name", ("lab9-exercise", "scara-pick", "rvm1-program", "hexapod-tripod", "omni-square")
)
def test_a_film_of_a_job_lasts_as_long_as_its_loop(name: str) -> None:
    job = plan_job(load(JOBS / f"{name}.toml"))
    scene = job_scene(job)
    frame_s = float(job.clock.seconds(job.trajectory.period))
    loop_s = frame_s * (len(job.trajectory.angles) - job.trajectory.loop_start)
    assert {len(part.frames) for part in scene.parts} == {scene.count}
    assert scene.count <= MAX_PICTURES
    assert scene.count * scene.picture_s == pytest.approx(loop_s, abs=scene.picture_s)


def test_servos_that_move_no_robot_cannot_be_filmed() -> None:
    with pytest.raises(InputError, match="nothing to film"):
        job_scene(plan_job(load(JOBS / "lab8-exercise.toml")))


def test_the_same_film_is_the_same_file(tmp_path: Path) -> None:
    whole = job_scene(plan_job(load(JOBS / "lab9-exercise.toml")))
    scene = replace(whole, parts=tuple(replace(part, frames=part.frames[::10]) for part in whole.parts))
    for name in ("a.gif", "b.gif"):
        film(scene, tmp_path / name)
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()


def test_each_picture_shows_its_frame_in_millimetres_and_the_time(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """At four pictures a second; a path beside it is the same in all pictures."""
    from matplotlib import animation

    taken: list[Any] = []

    class Animation:
        def __init__(self, figure: Any, show: Any, frames: int, init_func: Any) -> None:
            taken.extend((figure, show, frames))

        def save(self, path: str, writer: Any, dpi: int) -> None:
            taken.append(writer.fps)
            Path(path).write_bytes(b"film")

    monkeypatch.setattr(animation, "FuncAnimation", Animation)
    moving = [np.array([[0, 0, 0.01], [0.1, 0.1, 0.02 * each]]) for each in range(3)]
    path = np.array([[0.1, 0.1, 0], [0.1, 0.1, 0.04]])
    parts = (FilmPart(moving, "C0", 2.0), FilmPart([path] * 3, "0.6", 1.0, marks=False))
    film(FilmScene("three pictures", parts, 0.25, (28.0, -60.0)), tmp_path / "a.gif")
    figure, show, frames, rate = taken
    assert (frames, rate) == (3, 4)
    (axes,) = figure.axes
    for frame in (2, 0, 1):
        *lines, clock = show(frame)
        assert lines == list(axes.lines)
        for line, shown in zip(lines, (moving[frame], path), strict=True):
            assert pytest.approx(1000 * shown) == np.array(line.get_data_3d()).T
        assert clock.get_text() == f"{('0.00', '0.25', '0.50')[frame]} s"
    assert [line.get_marker() for line in axes.lines] == ["o", "None"]
    assert (tmp_path / "a.gif").read_bytes() == b"film"
