"""A moving picture of a robot: GIF through Pillow, MP4 through ffmpeg.

In: a walk, or a planned job. Out: a `FilmScene`, the parts of the robot frame by frame, and a file that plays
it at the speed of the robot.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from servogen.errors import InputError, Location, ToolError
from servogen.job import PlannedJob
from servogen.job.ends import End, to_place
from servogen.kinematics.protocol import WalkingRobot
from servogen.motion.drive import positions
from servogen.motion.gait.stability import support_polygon
from servogen.motion.gait.walk import Walk
from servogen.motion.trajectory import Floats
from servogen.outputs import write_bytes
from servogen.report.pictures import check_suffix, new_figure
from servogen.report.sticks import base_outline, leg_sticks, stick
from servogen.robot.model import Limb

SUFFIXES = (".gif", ".mp4")
DOTS_PER_INCH = 80
"""Fewer than a picture has, since a film consists of up to `MAX_PICTURES` of them."""
ROOM = 0.08
"""The free space around the robot as a share of its size."""

ZOOM = 0.9
"""The zoom with which the labels of tall and of wide robots stay inside the picture."""

MAX_PICTURES = 100
"""The maximum number of pictures in a film; longer motions lose some frames."""


@dataclass(frozen=True, slots=True, eq=False)
class FilmPart:
    """A line through points (corners, 3) in each picture, metres; dotted where `marks`."""

    frames: Sequence[Floats]
    colour: str
    width: float = 2.0
    marks: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class FilmScene:
    """Parts with equally many pictures of `picture_s` seconds; `view`: elevation and azimuth in degrees."""

    title: str
    parts: tuple[FilmPart, ...]
    picture_s: float
    view: tuple[float, float] = (28.0, -60.0)

    @property
    def count(self) -> int:
        return len(self.parts[0].frames)


def walk_scene(robot: WalkingRobot, planned: Walk) -> FilmScene:
    """Return the loop of a walk: the body, its legs, and the support polygon on the ground."""
    step = _step(len(planned.ground) - planned.trajectory.loop_start)
    shown = slice(planned.trajectory.loop_start, None, step)
    legs = [part[shown] for part in leg_sticks(robot, planned)]
    stand, down = (planned.feet + planned.corrections)[shown], planned.ground[shown]
    parts = _body(robot.limbs, len(down))
    if len(robot.limbs) > 2:
        parts.append(
            FilmPart([_polygon(feet[on]) for feet, on in zip(stand, down, strict=True)], "tab:green", 1.5)
        )
    parts += [FilmPart(list(leg), f"C{index % 10}") for index, leg in enumerate(legs)]
    frame_s = float(planned.trajectory.clock.seconds(planned.trajectory.period))
    return FilmScene(f"{robot.name}, x forward", tuple(parts), step * frame_s)


def job_scene(job: PlannedJob) -> FilmScene:
    """Return the loop of a job's robot, or all of a motion that ends. Raises InputError without a robot."""
    trajectory = job.trajectory
    start = trajectory.loop_start if len(trajectory.angles) - trajectory.loop_start > 1 else 0
    angles = _without_gaps(trajectory.angles)[start:]
    frame_s, step = float(trajectory.clock.seconds(trajectory.period)), _step(len(angles))
    if job.base is not None:
        places = positions(job.base, np.nan_to_num(angles[:, job.wheel_columns]), frame_s)[1:]
        outline = base_outline(job.base, places[::step])
        parts = [
            _trace(places * [1, 1, 0], step),
            *(FilmPart(list(line), "tab:blue", marks=False) for line in outline),
        ]
        return FilmScene(job.name, tuple(parts), step * frame_s, (90.0, -90.0))
    ends = job.ends
    if not ends:
        raise InputError(
            "missing-robot",
            "there is nothing to film: the servos move no robot",
            Location(job.file),
            "add [leg] or [robot]",
        )
    parts = _body(job.limbs, len(angles[::step]))
    for index, end in enumerate(ends):
        parts += [
            _trace(end.points(angles), step),
            FilmPart(list(_links(end, angles[::step])), f"C{index % 10}"),
        ]
    return FilmScene(job.name, tuple(parts), step * frame_s)


def _step(frames: int) -> int:
    return -(-frames // MAX_PICTURES)


def _without_gaps(angles: Floats) -> Floats:
    """Return angles without gaps: a servo without pulses keeps its angle, and begins at its first one."""
    filled = angles.copy()
    for column in filled.T:
        known = np.flatnonzero(~np.isnan(column))
        if len(known):
            column[:] = column[
                known[np.maximum(np.searchsorted(known, np.arange(len(column)), "right") - 1, 0)]
            ]
    return filled


def _links(end: End, angles: Floats) -> Floats:
    return to_place(end.place, stick(end.arm, end.joints(angles)))


def _trace(points: Floats, step: int) -> FilmPart:
    """Return the whole path as a part that every picture shows."""
    return FilmPart([points] * len(points[::step]), "0.6", 1.0, marks=False)


def _body(limbs: Sequence[Limb], count: int) -> list[FilmPart]:
    """Return the polygon through the mounts of the limbs; nothing for an arm, which has no body."""
    origins = np.array([[limb.mount.x, limb.mount.y, limb.mount.z] for limb in limbs if limb.mount])
    if not len(origins):
        return []
    around = np.argsort(np.arctan2(origins[:, 1], origins[:, 0]), kind="stable")
    return [FilmPart([origins[[*around, around[0]]]] * count, "0.35", 3.0, marks=False)]


def _polygon(feet: Floats) -> Floats:
    corners = support_polygon(feet[:, :2])
    closed = np.vstack((corners, corners[:1]))
    return np.column_stack((closed, np.full(len(closed), feet[:, 2].mean() if len(feet) else 0.0)))


def film(scene: FilmScene, path: Path) -> None:
    """Write the film. Raises InputError for an unknown ending, ToolError without matplotlib or ffmpeg."""
    check_suffix(path, SUFFIXES, "film")
    figure = new_figure(6.4, 5.2, scene.title)
    from matplotlib import animation

    kind = path.suffix.lower()
    if kind == ".mp4" and not animation.FFMpegWriter.isAvailable():
        raise ToolError(
            "tool-missing",
            "an MP4 needs ffmpeg, which is not installed",
            hint="install ffmpeg, or write a .gif",
        )
    figure.set_layout_engine("none")
    axes: Any = figure.add_axes((0.02, 0.03, 0.96, 0.92), projection="3d")
    lines = _set_up(axes, scene)
    clock = figure.text(0.99, 0.01, "", ha="right", fontsize=9)

    def show(frame: int) -> list[Any]:
        for line, part in zip(lines, scene.parts, strict=True):
            line.set_data_3d(*(1000 * part.frames[frame]).T)
        clock.set_text(f"{frame * scene.picture_s:.2f} s")
        return [*lines, clock]

    animated = animation.FuncAnimation(figure, show, frames=scene.count, init_func=lambda: lines)
    rate: Any = 1 / scene.picture_s
    writer: Any = animation.PillowWriter(fps=rate) if kind == ".gif" else animation.FFMpegWriter(fps=rate)
    with tempfile.TemporaryDirectory() as folder:
        # The writers take a name, not a file: the film is whole before it takes the name that was asked for.
        file = Path(folder) / f"film{kind}"
        animated.save(str(file), writer=writer, dpi=DOTS_PER_INCH)
        write_bytes(path, file.read_bytes())


def _set_up(axes: Any, scene: FilmScene) -> list[Any]:
    """Return empty lines in a box that holds all frames, with the same scale in all directions."""
    different = {id(corners): corners for part in scene.parts for corners in part.frames}
    points = 1000 * np.vstack(list(different.values()))
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    size = np.maximum(high - low, 0.05 * (high - low).max())
    middle = (low + high) / 2
    for setter, centre, extent in zip(
        (axes.set_xlim, axes.set_ylim, axes.set_zlim), middle, size * (0.5 + ROOM), strict=True
    ):
        setter(centre - extent, centre + extent)
    axes.set_box_aspect(tuple(size), zoom=ZOOM)
    axes.view_init(*scene.view)
    axes.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm")
    axes.tick_params(labelsize=7)
    if scene.view[0] == 90:
        axes.set(zlabel="", zticks=[])
    return [
        axes.plot([], [], [], "-o" if part.marks else "-", color=part.colour, lw=part.width, ms=3)[0]
        for part in scene.parts
    ]
