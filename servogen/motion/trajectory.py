"""`JointTrajectory`: joint angles frame by frame, what every kind of motion becomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError, did_you_mean
from servogen.robot.binding import Binding
from servogen.units import Clock, Cycles

Floats = npt.NDArray[np.float64]

MAX_FRAMES = 500_000
"""Of a motion, nearly three hours at 50 Hz. Whatever works on a motion holds all its frames in memory."""


@dataclass(frozen=True, slots=True, eq=False)
class JointTrajectory:
    """One row of `angles` a frame of `period` cycles, one column a joint, in radians.

    NaN: no pulse in that frame. The frames before `loop_start` are run once, those from it on for ever.
    """

    joints: tuple[str, ...]
    clock: Clock
    period: Cycles
    angles: Floats
    loop_start: int


def bound(trajectory: JointTrajectory, bindings: Sequence[Binding]) -> JointTrajectory:
    """The angles of the bindings' servos, in their order. Raises InputError for a joint that is not moved."""
    columns = []
    for binding in bindings:
        if binding.joint not in trajectory.joints:
            raise InputError(
                "unknown-joint",
                f"the motion does not move a joint '{binding.joint}'",
                hint=did_you_mean(binding.joint, trajectory.joints),
            )
        column = trajectory.angles[:, trajectory.joints.index(binding.joint)]
        columns.append(binding.servo_angle(column))
    return JointTrajectory(
        tuple(binding.servo for binding in bindings),
        trajectory.clock,
        trajectory.period,
        np.stack(columns, axis=1),
        trajectory.loop_start,
    )
