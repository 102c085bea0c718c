"""The feet or the tool that a job's servos move: where they are at angles of the servos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from servogen.kinematics.forward import fk_position
from servogen.kinematics.jacobian import jacobian
from servogen.kinematics.transforms import mount_matrix
from servogen.motion.trajectory import Floats
from servogen.robot.binding import Binding, joint_positions
from servogen.robot.model import Arm, Limb
from servogen.robot.servo import Servo


@dataclass(frozen=True, slots=True, eq=False)
class End:
    """A foot or tool: an `arm` placed by the matrix `place` (4, 4); `columns`: the servos of its joints."""

    name: str
    kind: Literal["foot", "tool"]
    arm: Arm
    place: Floats
    columns: tuple[int, ...]
    bindings: tuple[Binding, ...]

    def joints(self, angles: Floats) -> Floats:
        """Return joint positions (n, joints) from the angles (n, servos) of all servos."""
        return joint_positions(self.bindings, angles[:, list(self.columns)])

    def points(self, angles: Floats) -> Floats:
        """Return where it is (n, 3), in metres."""
        return to_place(self.place, fk_position(self.arm, self.joints(angles)))

    def shift(self, angles: Floats, change: Floats) -> Floats:
        """Return how far (n, 3) a small `change` of the servos' angles moves it: J · change of the joints."""
        slope = self.place[:3, :3] @ jacobian(self.arm, self.joints(angles))[:, :3, :]
        ratios = np.array([binding.ratio for binding in self.bindings])
        moved: Floats = np.einsum("nij,nj->ni", slope, change[:, list(self.columns)] / ratios)
        return moved


def moved_ends(
    limbs: Sequence[Limb], servos: Sequence[Servo], bindings: Sequence[Binding]
) -> tuple[End, ...]:
    """Return the ends of the limbs whose joints all have a servo."""
    column = {servo.name: index for index, servo in enumerate(servos)}
    by_joint = {binding.joint: binding for binding in bindings}
    return tuple(
        End(
            name=limb.name,
            kind=limb.end,
            arm=limb.arm,
            place=np.eye(4) if limb.mount is None else mount_matrix(limb.mount),
            columns=tuple(column[by_joint[name].servo] for name in limb.joints),
            bindings=tuple(by_joint[name] for name in limb.joints),
        )
        for limb in limbs
        if all(name in by_joint for name in limb.joints)
    )


def to_place(place: Floats, points: Floats) -> Floats:
    """Return points (..., 3) of an arm's own frame in the frame that the matrix `place` (4, 4) leads to."""
    return np.asarray(points @ place[:3, :3].T + place[:3, 3])
