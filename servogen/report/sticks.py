"""Robots as stick figures: joint positions frame by frame -> the corners of their links.

In: an `Arm` and joint positions (n, joints). Out: points (n, corners, 3) in metres; the last is the end.

    the lab's leg, from outside any other arm: along each row's z, then its x
    A───B                       (modified convention: along x, then z)
        │ C───D
         ╲│   │    β turns BC, D F stays vertical
          ╵   F
"""

from __future__ import annotations

import numpy as np

from servogen.kinematics.forward import link_frames
from servogen.kinematics.leg_kinds import LEG_KINDS
from servogen.kinematics.protocol import DrivingRobot, WalkingRobot
from servogen.motion.gait.walk import Walk
from servogen.motion.trajectory import Floats
from servogen.robot.model import Arm


def stick(arm: Arm, joints: Floats) -> Floats:
    """Return the corners of an arm or leg in its own frame, from its base to its end."""
    kind = LEG_KINDS.get(arm.closed_form or "")
    return kind.corners(arm, joints) if kind else _rows(arm, joints)


def _rows(arm: Arm, joints: Floats) -> Floats:
    frames = link_frames(arm, joints)
    points = [np.zeros((len(joints), 3)), frames[:, 0, :3, 3]]
    for index in range(len(arm.rows)):
        before, after = frames[:, index], frames[:, index + 1]
        step = after[:, :3, 3] - before[:, :3, 3]
        if arm.convention == "modified":
            axis = after[:, :3, 2]
            corner = after[:, :3, 3] - (step * axis).sum(axis=1, keepdims=True) * axis
        else:
            axis = before[:, :3, 2]
            corner = before[:, :3, 3] + (step * axis).sum(axis=1, keepdims=True) * axis
        points += [corner, after[:, :3, 3]]
    return np.stack([*points, frames[:, -1, :3, 3]], axis=1)


def leg_sticks(robot: WalkingRobot, planned: Walk) -> tuple[Floats, ...]:
    """Return the corners (frames, n, 3) of each leg in the body's level frame."""
    return tuple(
        robot.corners(index, planned.leg_angles[:, index]) @ planned.level.T
        for index in range(len(robot.limbs))
    )


def base_outline(base: DrivingRobot, pose: Floats) -> tuple[Floats, ...]:
    """Return the outline of a base at poses (n, 3), x, y and heading, as lines of (n, corners, 3) each."""
    outline = []
    for shape in base.outline():
        points = np.exp(1j * pose[:, 2:]) * shape + pose[:, :1] + 1j * pose[:, 1:2]
        outline.append(np.stack([points.real, points.imag, np.zeros(points.shape)], axis=-1))
    return tuple(outline)
