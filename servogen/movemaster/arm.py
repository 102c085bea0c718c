"""A robot arm as the language sees it: tool point, pitch and roll instead of joint positions.

In: an `Arm`, a tool length, poses in mm and degrees. Out: joint positions near the current ones, or
`Unreachable`;\nand poses from joint positions.

Pitch p and roll r are those of the RV-M1 in the vertical plane through the first axis and the tool point:

    R = Rot(z, φ) Rot(x, 90°) Rot(z, p + 90°) Rot(x, 90°) Rot(z, r),   φ = atan2(y, x)

so that p = q2 + q3 + q4 - 90° is the approach above the horizontal and r = q5 (the language's specification).
The same commands work for any arm whose inverse kinematics accepts an orientation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.forward import fk
from servogen.kinematics.inverse.solve import ik, solutions_near
from servogen.kinematics.transforms import Floats, rot
from servogen.movemaster.memory import Pose
from servogen.robot.model import Arm

_ON_AXIS = 1e-9
"""Nearer than this (metres) to the first axis the tool has no azimuth: home's is taken."""


@dataclass(frozen=True, slots=True)
class Manipulator:
    """An arm whose tool length is set by TL; `speeds` are its joints' maximum speeds, in radians (metres) per
    second.
    """

    arm: Arm
    speeds: tuple[float, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.arm.joints)

    @property
    def tool_mm(self) -> float:
        return 1000 * self.arm.tool.z

    def with_tool_mm(self, length: float) -> Manipulator:
        return replace(self, arm=self.arm.with_tool(replace(self.arm.tool, z=length / 1000)))

    def pose(self, q: Floats) -> Pose:
        """Return the tool's pose at the joint positions `q`."""
        matrix = fk(self.arm, q)
        x, y, z = (float(value) for value in matrix[:3, 3])
        n, o, a = matrix[:3, 0], matrix[:3, 1], matrix[:3, 2]
        azimuth = float(self._azimuth(x, y))
        cosine, sine = math.cos(azimuth), math.sin(azimuth)
        lean, side_n, side_o = (
            cosine * a[0] + sine * a[1],
            sine * n[0] - cosine * n[1],
            sine * o[0] - cosine * o[1],
        )
        if not self.arm.orientation:
            return Pose(1000 * x, 1000 * y, 1000 * z, 0.0, 0.0)
        pitch = _degrees(math.atan2(lean, -a[2]) - math.pi / 2)
        return Pose(1000 * x, 1000 * y, 1000 * z, pitch, _degrees(math.atan2(side_n, side_o)))

    def solve(self, pose: Pose, near: Floats) -> Floats:
        """Return the joint positions for `pose` that are nearest to `near`. Raises `Unreachable` or
        InputError.
        """
        point = np.array([pose.x, pose.y, pose.z]) / 1000
        if not self.arm.orientation:
            if pose.p or pose.r:
                raise InputError(
                    "wrong-count",
                    f"{self.arm.name} takes no pitch and roll: they are 0, not {pose.p:g} and {pose.r:g}",
                )
            return ik(self.arm, point, None, near)
        return ik(self.arm, point, self._rotation(pose), near)

    def solutions(self, poses: Floats, near: Floats) -> Floats:
        """Return the joint positions (n, solutions, joints) for poses (n, 5), NaN where there is no solution.

        Each is in the turn nearest to `near` (n, joints).
        """
        turns = self._rotations(poses) if self.arm.orientation else None
        return solutions_near(self.arm, poses[:, :3] / 1000, turns, near)

    def approach(self, pose: Pose) -> Floats:
        """Return the unit vector along the tool."""
        if not self.arm.orientation:
            raise InputError("wrong-robot-kind", f"{self.arm.name} has no direction of its tool of its own")
        return np.asarray(self._rotation(pose)[:, 2])

    def _rotation(self, pose: Pose) -> Floats:
        return np.asarray(self._rotations(np.array([pose.values]))[0])

    def _rotations(self, poses: Floats) -> Floats:
        """Return the rotations (n, 3, 3) of poses (n, 5)."""
        x, y, _, pitch, roll = poses.T
        turns = (
            rot("z", self._azimuth(x / 1000, y / 1000)),
            rot("x", np.pi / 2),
            rot("z", np.radians(pitch) + np.pi / 2),
            rot("x", np.pi / 2),
            rot("z", np.radians(roll)),
        )
        return np.asarray(turns[0] @ turns[1] @ turns[2] @ turns[3] @ turns[4])

    def _azimuth(self, x: ArrayLike, y: ArrayLike) -> Floats:
        return np.where(np.hypot(x, y) > _ON_AXIS, np.arctan2(y, x), self.arm.home[0])


def _degrees(angle: float) -> float:
    """Return an angle in degrees, in (-180°, 180°]."""
    return 180 - (180 - math.degrees(angle)) % 360


def manipulator(arm: Arm, speeds: tuple[float | None, ...] | None = None) -> Manipulator:
    """Return `arm` with its joints' maximum speeds, or the given `speeds`. Raises InputError if there are
    none.
    """
    chosen = speeds or tuple(joint.speed for joint in arm.joints)
    known = []
    for joint, speed in zip(arm.joints, chosen, strict=True):
        if speed is None:
            raise InputError(
                "no-speed",
                f"nothing says how fast {arm.name}'s joint {joint.name} may move",
                hint="give its speed_deg_s in the robot's file, or bind it to a servo with a known speed",
            )
        known.append(speed)
    if (arm.tool.x, arm.tool.y, arm.tool.rx, arm.tool.ry) != (0.0, 0.0, 0.0, 0.0):
        raise InputError(
            "wrong-robot-kind", f"{arm.name}'s tool is not on its approach axis: TL sets a length along it"
        )
    return Manipulator(arm, tuple(known))
