"""Configuration vectors of an `Arm`: W = (p, e^{θ/π} a), θ the position of the joint that rolls the tool.

In: joint positions (..., n), or one vector (6,) in metres. Out: vectors (..., 6), or all joint positions of
one. Only an arm whose last joint turns about the approach vector has a roll: the rest of the tool's
orientation is the approach vector.
"""

from __future__ import annotations

from dataclasses import replace
from math import degrees, pi

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.forward import fk, joint_array, row_axes
from servogen.kinematics.inverse import numerical
from servogen.kinematics.inverse.solve import free_joints, ik_all, sorted_without_doubles
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.orientation import configuration_vector, from_configuration_vector
from servogen.kinematics.transforms import Floats
from servogen.robot.model import Arm

PARALLEL = 1e-9
"""The difference from 1 of the cosine between two directions that count as parallel."""


TYPED_M, TYPED_RAD = 1e-5, 1e-4
"""How far the position and approach vector may be from those that an arm with few joints reaches: the digits
that were left out.
"""


def has_roll(arm: Arm) -> bool:
    """Return whether the last joint turns the tool about its approach vector, and does nothing else."""
    last = len(arm.joints) - 1
    if last < 0 or not arm.joints[last].turning:
        return False
    axes, pose = row_axes(arm, arm.home)
    moved = [axis for axis in axes if axis.row.joint == last]
    if len(moved) != 1 or moved[0].row.ratio != 1.0:
        return False
    approach = pose[:3, 2]
    away = np.linalg.norm(np.cross(moved[0].direction, pose[:3, 3] - moved[0].point))
    return bool(abs(abs(moved[0].direction @ approach) - 1) < PARALLEL and away < PARALLEL)


def configuration_of(arm: Arm, q: ArrayLike) -> Floats:
    """Return the configuration vectors (..., 6) of joint positions (..., n), the position in metres.

    Raises InputError for an arm without a joint that rolls its tool.
    """
    _check_roll(arm)
    q = joint_array(arm, q)
    pose = fk(arm, q)
    return configuration_vector(pose[..., :3, 3], pose[..., :3, 2], q[..., -1])


def ik_of_configuration(arm: Arm, vector: ArrayLike) -> Floats:
    """Return all joint positions (solutions, n) that have a configuration vector (6,), nearest to home first.

    An arm with fewer than six joints reaches some approach vectors only: those of the nearest vector are
    returned if it is within `TYPED_M` and `TYPED_RAD`.
    Raises InputError, or `Unreachable`, for a vector that no joint positions within the limits have.
    """
    _check_roll(arm)
    position, approach, roll = from_configuration_vector(vector)
    joint = arm.joints[-1]
    if not joint.lower - PARALLEL <= roll <= joint.upper + PARALLEL:
        raise InputError(
            "out-of-reach",
            f"{joint.name} would have to roll the tool to {degrees(float(roll)):z.3f}°",
            hint=f"its limits are {degrees(joint.lower):zg}° to {degrees(joint.upper):zg}°",
        )
    # With any orientation about the approach vector the other joints are the same; only the last one differs.
    free = _any_roll(arm)
    turn = _any_about(approach)
    try:
        solutions = ik_all(free, position, turn)
    except Unreachable:
        solution = numerical.search(free, position, turn)
        if not (solution.distance_m[0] <= TYPED_M and solution.angle[0] <= TYPED_RAD):
            raise
        # The nearest vector that the arm reaches has exact solutions.
        pose = fk(free, solution.q[0])
        solutions = ik_all(free, pose[:3, 3], pose[:3, :3])
    solutions[:, -1] = roll
    return sorted_without_doubles(arm, solutions, None)


def free_of_configuration(arm: Arm, solutions: Floats) -> tuple[str, ...]:
    """Return the joints that can move while the configuration vector stays the same, at one of `solutions`.

    The tool may turn about its approach vector, which the last joint would undo.
    """
    last = arm.joints[-1].name
    return tuple(name for name in free_joints(_any_roll(arm), solutions, oriented=True) if name != last)


def _any_roll(arm: Arm) -> Arm:
    """Return the arm with a last joint that rolls the tool all around."""
    return replace(arm, joints=(*arm.joints[:-1], replace(arm.joints[-1], lower=-pi, upper=pi, home=0.0)))


def _check_roll(arm: Arm) -> None:
    if not has_roll(arm):
        raise InputError(
            "wrong-robot-kind",
            f"{arm.name} has no configuration vector: its last joint does not roll the tool",
            hint="give the orientation in another form",
        )


def _any_about(approach: Floats) -> Floats:
    """Return a rotation (3, 3) whose third column is the unit vector `approach`."""
    # The unit vector farthest from `approach`, so that the cross product is not small.
    other = np.eye(3)[int(np.argmin(np.abs(approach)))]
    normal = np.cross(approach, other)
    normal = normal / np.linalg.norm(normal)
    return np.stack([normal, np.cross(approach, normal), approach], axis=-1)
