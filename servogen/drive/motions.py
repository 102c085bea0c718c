"""Motions to drive: a pose, or a trajectory at its own speed.

In: servo angles. Out: `at`, the angle of every servo at a moment, in radians; NaN for a servo that does not
move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from servogen.errors import InputError, Location, check_known
from servogen.inputs import count_in
from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.robot.servo import Servo


class AngleFunction(Protocol):
    """Servo angles as a function of time."""

    def at(self, seconds: float) -> Floats | None:
        """Return the angles (servos,) at `seconds` after the start; None once the motion is over."""


@dataclass(frozen=True, slots=True, eq=False)
class Still:
    """A pose that is held endlessly."""

    angles: Floats

    def at(self, seconds: float) -> Floats | None:
        """Return the angles at a moment."""
        return self.angles


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A trajectory, frame by frame, with its loop repeated; a loop of a single frame ends the motion."""

    trajectory: JointTrajectory

    def at(self, seconds: float) -> Floats | None:
        """Return the angles at a moment."""
        angles, loop_start = self.trajectory.angles, self.trajectory.loop_start
        frames, loop = len(angles), len(angles) - loop_start
        frame = frame_at(self.trajectory, seconds)
        if loop == 1 and frame > frames:
            return None
        if frame >= frames:
            frame = loop_start + (frame - loop_start) % loop
        return np.asarray(angles[frame])


@dataclass(frozen=True, slots=True)
class Limited:
    """A motion that is over after `seconds`."""

    motion: AngleFunction
    seconds: float

    def at(self, seconds: float) -> Floats | None:
        """Return the angles at a moment."""
        return self.motion.at(seconds) if seconds <= self.seconds else None


ALMOST = 1e-6
"""The fraction of a frame by which a moment may precede a frame and still count as its beginning."""


def frame_at(trajectory: JointTrajectory, seconds: float) -> int:
    """Return the index of the frame at a moment."""
    return int(seconds / float(trajectory.clock.seconds(trajectory.period)) + ALMOST)


def find_pose(job: PlannedJob, text: str) -> Floats:
    """Return the pose with a number (from 1) or a name in the job, or that of `servo=degrees,…`, in radians.

    Servos that are not named are NaN. Raises InputError for an unknown pose or servo and for an angle outside
    a servo's limits.
    """
    if "=" in text:
        return _angles(job.servos, text)
    place = Location(job.file)
    if not job.poses:
        raise InputError("unknown-name", "the job has no poses", place, "state angles: --pose arm=90,hand=45")
    names = {pose.name: index for index, pose in enumerate(job.poses) if pose.name}
    if text in names:
        return np.array(job.poses[names[text]].angles)
    number = count_in(text)
    if number is not None and 1 <= number <= len(job.poses):
        return np.array(job.poses[number - 1].angles)
    raise InputError(
        "unknown-name",
        f"the job has no pose '{text}'",
        place,
        f"1 to {len(job.poses)}" + (", or a name" if names else ""),
    )


def _angles(servos: Sequence[Servo], text: str) -> Floats:
    """Return the angles of `servo=degrees,…`, NaN for servos that are not named. Raises InputError."""
    by_name = {servo.name: index for index, servo in enumerate(servos)}
    angles = np.full(len(servos), np.nan)
    for part in text.split(","):
        name, _, value = (word.strip() for word in part.partition("="))
        check_known("unknown-servo", name, by_name, f"there is no servo '{name}'")
        try:
            angle = float(np.radians(float(value)))
        except ValueError:
            raise InputError(
                "bad-angle", f"'{value}' is not an angle in degrees", hint=f"{name}=90"
            ) from None
        servos[by_name[name]].check(angle)
        angles[by_name[name]] = angle
    return angles
