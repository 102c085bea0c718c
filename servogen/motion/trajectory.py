"""`JointTrajectory`: joint angles frame by frame, the result of every kind of motion; binding to servos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from servogen.errors import check_known
from servogen.robot.binding import Binding
from servogen.units import Clock, Cycles

Floats = npt.NDArray[np.float64]

MAX_FRAMES = 500_000
"""The maximum length of a motion, nearly three hours at 50 Hz: all frames are held in memory."""


@dataclass(frozen=True, slots=True, eq=False)
class JointTrajectory:
    """`angles` in radians, one row per frame of `period` cycles and one column per joint.

    NaN: no pulse in that frame. The frames before `loop_start` are played once, the others repeatedly.
    """

    joints: tuple[str, ...]
    clock: Clock
    period: Cycles
    angles: Floats
    loop_start: int

    def __repr__(self) -> str:
        frames = f"{self.loop_start} + {len(self.angles) - self.loop_start} frames"
        return f"<JointTrajectory {', '.join(self.joints)}; {frames}>"

    def without(self, frames: int) -> JointTrajectory:
        """Return the motion from its frame number `frames` on."""
        if frames <= self.loop_start:
            return replace(self, angles=self.angles[frames:], loop_start=self.loop_start - frames)
        loop = self.angles[self.loop_start :]
        return replace(self, angles=np.roll(loop, self.loop_start - frames, axis=0), loop_start=0)


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a motion that its author wrote, such as a segment of a route: it begins at frame `begin`."""

    name: str
    begin: int


def bound(trajectory: JointTrajectory, bindings: Sequence[Binding]) -> JointTrajectory:
    """Return the trajectory of the bindings' servos, in their order. Raises InputError if a joint is
    missing.
    """
    columns = []
    for binding in bindings:
        said = f"the motion does not move a joint '{binding.joint}'"
        check_known("unknown-joint", binding.joint, trajectory.joints, said)
        column = trajectory.angles[:, trajectory.joints.index(binding.joint)]
        columns.append(binding.servo_angle(column))
    return JointTrajectory(
        joints=tuple(binding.servo for binding in bindings),
        clock=trajectory.clock,
        period=trajectory.period,
        angles=np.stack(columns, axis=1),
        loop_start=trajectory.loop_start,
    )
