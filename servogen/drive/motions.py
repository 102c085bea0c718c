"""What is driven: a pose, or a trajectory in its own time.

In: servo angles. Out: `at`, the angles of every servo at a moment, radians; NaN where a servo is left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from servogen.errors import InputError, Location, did_you_mean
from servogen.job import PlannedJob
from servogen.motion.trajectory import Floats, JointTrajectory
from servogen.robot.servo import Servo


class Motion(Protocol):
    """Angles (servos,) at `seconds` since it began; None once it is over."""

    def at(self, seconds: float) -> Floats | None: ...


@dataclass(frozen=True, slots=True, eq=False)
class Still:
    """A pose, for ever."""

    angles: Floats

    def at(self, seconds: float) -> Floats | None:
        return self.angles


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A trajectory frame by frame, its loop for ever; one that ends is over at its last frame."""

    trajectory: JointTrajectory

    def at(self, seconds: float) -> Floats | None:
        made = self.trajectory
        frames, loop = len(made.angles), len(made.angles) - made.loop_start
        frame = frame_at(made, seconds)
        if loop == 1 and frame > frames:
            return None
        if frame >= frames:
            frame = made.loop_start + (frame - made.loop_start) % loop
        return np.asarray(made.angles[frame])


@dataclass(frozen=True, slots=True)
class Limited:
    """A motion that is over after `seconds`."""

    motion: Motion
    seconds: float

    def at(self, seconds: float) -> Floats | None:
        return self.motion.at(seconds) if seconds <= self.seconds else None


ALMOST = 1e-6
"""Of a frame: a moment that is nearly the next frame's beginning is."""


def frame_at(trajectory: JointTrajectory, seconds: float) -> int:
    """The frame that lasts at that moment."""
    return int(seconds / float(trajectory.clock.seconds(trajectory.period)) + ALMOST)


def pose_of(job: PlannedJob, text: str) -> Floats:
    """A pose by its number (from 1) or name in the job, or `servo=degrees,…`; servos that are not named stay.

    Raises InputError for a pose or servo that is not there and an angle that a servo does not allow.
    """
    if "=" in text:
        return _angles(job.servos, text)
    place = Location(job.file)
    if not job.poses:
        raise InputError("unknown-pose", "the job has no poses", place, "give angles: --pose arm=90,hand=45")
    names = {pose.name: index for index, pose in enumerate(job.poses) if pose.name}
    if text in names:
        return np.array(job.poses[names[text]].angles)
    if text.isdecimal() and 1 <= int(text) <= len(job.poses):
        return np.array(job.poses[int(text) - 1].angles)
    raise InputError(
        "unknown-pose",
        f"the job has no pose '{text}'",
        place,
        f"1 to {len(job.poses)}" + (", or a name" if names else ""),
    )


def _angles(servos: Sequence[Servo], text: str) -> Floats:
    by_name = {servo.name: index for index, servo in enumerate(servos)}
    angles = np.full(len(servos), np.nan)
    for part in text.split(","):
        name, _, value = (word.strip() for word in part.partition("="))
        if name not in by_name:
            raise InputError("unknown-servo", f"there is no servo '{name}'", hint=did_you_mean(name, by_name))
        try:
            angle = float(np.radians(float(value)))
        except ValueError:
            raise InputError("bad-angle", f"'{value}' is no angle in degrees", hint=f"{name}=90") from None
        servos[by_name[name]].width_us(angle)
        angles[by_name[name]] = angle
    return angles
