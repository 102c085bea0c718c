"""A robot's trajectory as its servos'.

In: a trajectory of joints and the bindings of joints to servos. Out: the same frames with a column a servo.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from servogen.errors import InputError, did_you_mean
from servogen.motion.trajectory import JointTrajectory
from servogen.robot.binding import Binding


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
