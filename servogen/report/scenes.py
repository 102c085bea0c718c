"""What a film shows: the parts of a robot frame by frame.

In: a walk, or a job and its tracks. Out: `Scene`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from servogen.errors import InputError, Location
from servogen.job import PlannedJob
from servogen.kinematics.protocol import WalkingRobot
from servogen.motion.drive import positions
from servogen.motion.gait.stability import support_polygon
from servogen.motion.gait.walk import Walk
from servogen.motion.trajectory import Floats
from servogen.report.gait_facts import leg_sticks
from servogen.report.sticks import base_outline, stick
from servogen.report.tracks import End, ends_of, to_place
from servogen.robot.model import Limb

MOST_PICTURES = 100
"""Of a film: longer motions leave frames out."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A line through points (corners, 3) in each picture, metres; dotted where `marks`."""

    frames: Sequence[Floats]
    colour: str
    width: float = 2.0
    marks: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Parts with equally many pictures of `picture_s` seconds; `view`: elevation and azimuth in degrees."""

    title: str
    parts: tuple[Part, ...]
    picture_s: float
    view: tuple[float, float] = (28.0, -60.0)

    @property
    def count(self) -> int:
        return len(self.parts[0].frames)


def walk_scene(robot: WalkingRobot, made: Walk) -> Scene:
    """The loop of a walk: the body, its legs, and the support polygon on the ground."""
    step = _step(len(made.ground) - made.trajectory.loop_start)
    shown = slice(made.trajectory.loop_start, None, step)
    legs = [part[shown] for part in leg_sticks(robot, made)]
    stand, down = (made.feet + made.corrections)[shown], made.ground[shown]
    parts = _body(robot.limbs, len(down))
    if len(robot.limbs) > 2:
        parts.append(
            Part([_polygon(feet[on]) for feet, on in zip(stand, down, strict=True)], "tab:green", 1.5)
        )
    parts += [Part(list(leg), f"C{index % 10}") for index, leg in enumerate(legs)]
    frame_s = float(made.trajectory.clock.seconds(made.trajectory.period))
    return Scene(f"{robot.name}, x forward", tuple(parts), step * frame_s)


def job_scene(job: PlannedJob) -> Scene:
    """The loop of a job's robot, or all of a motion that ends. Raises InputError where there is no robot."""
    made = job.trajectory
    start = made.loop_start if len(made.angles) - made.loop_start > 1 else 0
    angles = _held(made.angles)[start:]
    frame_s, step = float(made.clock.seconds(made.period)), _step(len(angles))
    if job.base is not None:
        at = positions(job.base, np.nan_to_num(angles[:, job.wheel_columns]), frame_s)[1:]
        outline = base_outline(job.base, at[::step])
        parts = [
            _trace(at * [1, 1, 0], step),
            *(Part(list(each), "tab:blue", marks=False) for each in outline),
        ]
        return Scene(job.name, tuple(parts), step * frame_s, (90.0, -90.0))
    ends = ends_of(job)
    if not ends:
        raise InputError(
            "missing-robot",
            "there is nothing to film: the servos move no robot",
            Location(job.file),
            "add [leg] or [robot]",
        )
    parts = _body(job.limbs, len(angles[::step]))
    for index, end in enumerate(ends):
        parts += [_trace(end.points(angles), step), Part(list(_links(end, angles[::step])), f"C{index % 10}")]
    return Scene(job.name, tuple(parts), step * frame_s)


def _step(frames: int) -> int:
    return -(-frames // MOST_PICTURES)


def _held(angles: Floats) -> Floats:
    """A servo without pulses stays where it was; before its first pulse it is where that puts it."""
    held = angles.copy()
    for column in held.T:
        known = np.flatnonzero(~np.isnan(column))
        if len(known):
            column[:] = column[
                known[np.maximum(np.searchsorted(known, np.arange(len(column)), "right") - 1, 0)]
            ]
    return held


def _links(end: End, angles: Floats) -> Floats:
    return to_place(end.place, stick(end.arm, end.joints(angles)))


def _trace(points: Floats, step: int) -> Part:
    """The whole path, in each of the pictures."""
    return Part([points] * len(points[::step]), "0.6", 1.0, marks=False)


def _body(limbs: Sequence[Limb], count: int) -> list[Part]:
    """Return the polygon through the mounts of the limbs; nothing for an arm, which has no body."""
    origins = np.array([[limb.mount.x, limb.mount.y, limb.mount.z] for limb in limbs if limb.mount])
    if not len(origins):
        return []
    around = np.argsort(np.arctan2(origins[:, 1], origins[:, 0]), kind="stable")
    return [Part([origins[[*around, around[0]]]] * count, "0.35", 3.0, marks=False)]


def _polygon(feet: Floats) -> Floats:
    corners = support_polygon(feet[:, :2])
    closed = np.vstack((corners, corners[:1]))
    return np.column_stack((closed, np.full(len(closed), feet[:, 2].mean() if len(feet) else 0.0)))
