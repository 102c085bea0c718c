"""The orientation of a target in the robot's own terms, at one point or along a path.

In: an `Arm`, positions in metres, the values that its targets take beside x, y, z in radians. Out: rotations
(..., 3, 3) for `inverse`.

Between two orientations the tool turns the short way: arms that take φ θ η turn evenly about one axis
(slerp). Arms with fewer joints cannot in general: their pitch and roll change evenly, neither by more than
half a turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.forward import fk
from servogen.kinematics.orientation import slerp
from servogen.kinematics.transforms import Floats, rot
from servogen.robot.model import Arm


def orientation_names(arm: Arm) -> tuple[str, ...]:
    """Name what a target may give beside x, y, z, one name for each number."""
    return ("phi", "theta", "eta") if arm.orientation == ("rpy",) else arm.orientation


def orientation_matrix(arm: Arm, position: ArrayLike, values: ArrayLike) -> Floats:
    """Return the rotations (..., 3, 3) of targets at positions (..., 3) with the values (..., k).

    `rpy`: Rot(z, φ) Rot(y, θ) Rot(x, η). Arms with fewer joints: the angle `roll` about the approach, and for
    the RV-M1 before it the `pitch` of the approach above the horizontal; the rest follows from the position.
    """
    names, given = orientation_names(arm), np.asarray(values, float)
    if given.shape[-1:] != (len(names),):
        wanted = ", ".join(names) or "nothing"
        raise InputError(
            "wrong-count",
            f"{arm.name} takes {wanted} beside x, y, z, not {given.size} values",
            hint="angles in degrees",
        )
    angles = np.moveaxis(given, -1, 0)
    if arm.orientation == ("rpy",):
        return np.asarray(rot("z", angles[0]) @ rot("y", angles[1]) @ rot("x", angles[2]))
    if arm.closed_form == "scara":
        return np.asarray(rot("z", angles[0]) @ rot("x", np.pi))
    x, y, z = np.moveaxis(np.asarray(position, float), -1, 0)
    out = np.hypot(x, y)
    q = np.empty((*np.broadcast_shapes(out.shape, given.shape[:-1]), len(arm.joints)))
    q[...] = arm.home
    q[..., 0] = np.where(out > 1e-12, np.arctan2(y, x), arm.home[0])
    if arm.closed_form == "rv-m1":
        q[..., 1:3] = 0.0
        q[..., 3], q[..., 4] = angles[0] + np.pi / 2, angles[1]
    elif arm.closed_form == "cylindrical":
        q[..., 3] = angles[0]
    else:
        q[..., 1], q[..., 2] = np.arctan2(z - arm.length["l1"], out), angles[0]
    return fk(arm, q)[..., :3, :3]


def rotations_between(
    arm: Arm, position: ArrayLike, first: ArrayLike, last: ArrayLike, share: ArrayLike
) -> Floats:
    """Return the rotations (n, 3, 3) at positions (n, 3) and shares (n,) of the short way between values."""
    share = np.asarray(share, float)
    one, other = np.asarray(first, float), np.asarray(last, float)
    if arm.orientation == ("rpy",):
        ends = orientation_matrix(arm, np.zeros(3), np.stack([one, other]))
        return slerp(ends[0], ends[1], share)
    return orientation_matrix(arm, position, one + share[:, None] * short_way(other - one))


def short_way(angle: ArrayLike) -> Floats:
    """Return angles that differ from the given ones by whole turns, none of more than half a turn."""
    angle = np.asarray(angle, float)
    return np.asarray(angle - 2 * np.pi * np.rint(angle / (2 * np.pi)))
