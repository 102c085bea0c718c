"""Orientation: the twelve orders of three angles, axis and angle, quaternions, the configuration vector.

In and out: radians, rotations (..., 3, 3), angles (..., 3). An order names the axes as the product
does: "ZYX" (roll, pitch, yaw) is Rot(z, φ) Rot(y, θ) Rot(x, η), "ZYZ" is Rot(z, φ) Rot(y, θ) Rot(z, ψ).

Conventions for singular cases: where one degree of freedom is lost (θ = ±90° for three different axes, θ = 0
or π for a repeated one) the first angle is 0 and the third takes the whole turn. A rotation by 0 has the axis
z; by π the axis whose first component that is not zero is positive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError, did_you_mean
from servogen.kinematics.forward import fk
from servogen.kinematics.transforms import AXES, Floats, rot, skew
from servogen.robot.model import Arm

ORDERS = ("ZXZ", "XYX", "YZY", "ZYZ", "XZX", "YXY", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")

_LOST = 1e-12
"""Below this the first angle is lost in rounding."""


def _order(order: str) -> tuple[int, int, int, float]:
    """Return the three axes and the sign of the first two with the axis that is neither."""
    if order.upper() not in ORDERS:
        raise InputError(
            "bad-rotation", f"'{order}' is not an order of three angles", hint=did_you_mean(order, ORDERS)
        )
    first, second, third = (AXES[letter] for letter in order.lower())
    return first, second, third, 1.0 if (second - first) % 3 == 1 else -1.0


def from_angles(angles: ArrayLike, order: str) -> Floats:
    """Return the rotation (..., 3, 3) of the angles (..., 3) in an order of `ORDERS`."""
    _order(order)
    angles = np.asarray(angles, float)
    one, two, three = (rot(axis, angles[..., index]) for index, axis in enumerate(order.lower()))
    return np.asarray(one @ two @ three)


def to_angles(rotation: ArrayLike, order: str, second: bool = False) -> Floats:
    """Return the angles (..., 3) of a rotation in an order; `second` gives the other solution, first angle +
    π.

    The first angle comes from the column of the third axis, which the third rotation does not move; the other
    two from what remains when the first rotation is undone, by atan2, so that the angles give the rotation
    back to rounding, near the singular cases too.
    """
    i, j, k, sign = _order(order)
    # The axis that is neither the first nor the second.
    m = 3 - i - j
    matrix = np.asarray(rotation, float)
    if i == k:
        up, across = matrix[..., j, i], -sign * matrix[..., m, i]
    else:
        up, across = -sign * matrix[..., j, k], matrix[..., k, k]
    lost = np.hypot(up, across) < _LOST
    one = np.where(lost, 0.0, np.arctan2(up, across) + (np.pi if second else 0.0))
    one = np.where(one > np.pi, one - 2 * np.pi, one)
    rest = rot("xyz"[i], -one) @ matrix
    if i == k:
        two = np.arctan2(-sign * rest[..., m, i], rest[..., i, i])
        three = np.arctan2(-sign * rest[..., j, m], rest[..., j, j])
    else:
        two = np.arctan2(sign * rest[..., i, k], rest[..., k, k])
        three = np.arctan2(sign * rest[..., j, i], rest[..., j, j])
    return np.stack([one, two, three], axis=-1)


def from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> Floats:
    """Return Rodrigues' R = I + sin θ K + (1 - cos θ) K², K = skew(axis), for an axis (..., 3)
    of any length.
    """
    axis, angle = np.asarray(axis, float), np.asarray(angle, float)[..., None, None]
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    if np.any(length == 0.0):
        raise InputError("bad-rotation", "an axis of length 0 has no direction")
    cross = skew(axis / length)
    # 2 sin²(θ/2) is 1 - cos θ without its cancellation near 0
    return np.asarray(np.eye(3) + np.sin(angle) * cross + 2 * np.sin(angle / 2) ** 2 * (cross @ cross))


def to_axis_angle(rotation: ArrayLike) -> tuple[Floats, Floats]:
    """Return the axis (..., 3) and angle (...) in [0, π]; through the quaternion, so safe near 0 and π."""
    quaternion = to_quaternion(rotation)
    vector = quaternion[..., 1:]
    length = np.linalg.norm(vector, axis=-1)
    angle = 2 * np.arctan2(length, np.maximum(quaternion[..., 0], 0.0))
    still = length == 0.0
    axis = np.where(still[..., None], [0.0, 0.0, 1.0], vector / np.where(still, 1.0, length)[..., None])
    return axis, angle


def to_quaternion(rotation: ArrayLike) -> Floats:
    """Return the unit quaternion (..., 4), scalar first and not negative, of a rotation.

    Four products give it, each times one of its components; the one with the largest component is used, so
    that there is no division by a small number.
    """
    r = np.asarray(rotation, float)
    d = [r[..., axis, axis] for axis in range(3)]
    w, x, y = r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]
    p, q, s = r[..., 1, 0] + r[..., 0, 1], r[..., 2, 0] + r[..., 0, 2], r[..., 2, 1] + r[..., 1, 2]
    rows = np.stack(
        [
            np.stack([1 + d[0] + d[1] + d[2], w, x, y], axis=-1),
            np.stack([w, 1 + d[0] - d[1] - d[2], p, q], axis=-1),
            np.stack([x, p, 1 - d[0] + d[1] - d[2], s], axis=-1),
            np.stack([y, q, s, 1 - d[0] - d[1] + d[2]], axis=-1),
        ],
        axis=-2,
    )
    # Row k is 4 q_k q: its diagonal element is 4 q_k².
    largest = np.argmax(np.diagonal(rows, axis1=-2, axis2=-1), axis=-1)
    quaternion = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    quaternion = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return np.asarray(quaternion * _leading_sign(quaternion)[..., None])


def from_quaternion(quaternion: ArrayLike) -> Floats:
    """Return the rotation (..., 3, 3) of a quaternion (..., 4) of any length, scalar first."""
    quaternion = np.asarray(quaternion, float)
    square = np.sum(quaternion * quaternion, axis=-1)[..., None, None]
    if np.any(square == 0.0):
        raise InputError("bad-rotation", "a quaternion of length 0 is not a rotation")
    scalar, cross = quaternion[..., 0, None, None], skew(quaternion[..., 1:])
    return np.asarray(np.eye(3) + 2 / square * (scalar * cross + cross @ cross))


def _leading_sign(vectors: Floats) -> Floats:
    """Return the sign of the first component of (..., n) that is not zero to rounding."""
    seen = np.abs(vectors) > 1e-15
    first = np.take_along_axis(vectors, np.argmax(seen, axis=-1)[..., None], axis=-1)[..., 0]
    return np.where(first < 0, -1.0, 1.0)


def rotation_vector(rotation: ArrayLike) -> Floats:
    """Return axis times angle (..., 3): the error of an orientation that a numerical method
    drives to zero.
    """
    axis, angle = to_axis_angle(rotation)
    return np.asarray(axis * angle[..., None])


def slerp(first: ArrayLike, last: ArrayLike, share: ArrayLike) -> Floats:
    """Return the rotations (n, 3, 3) at the shares (n,) of the shortest turn from `first` to `last` (3, 3).

    R(s) = first exp(s log(firstᵀ last)): about one axis, evenly, by at most half a turn.
    """
    start = np.asarray(first, float)
    axis, angle = to_axis_angle(start.T @ np.asarray(last, float))
    share = np.asarray(share, float)
    return np.asarray(start @ from_axis_angle(np.broadcast_to(axis, (*share.shape, 3)), share * angle))


def configuration_vector(position: ArrayLike, approach: ArrayLike, roll: ArrayLike) -> Floats:
    """Return W = (p, e^{θ/π} a), shape (..., 6): position, and the approach vector scaled by the roll θ."""
    scaled = np.exp(np.asarray(roll, float) / np.pi)[..., None] * np.asarray(approach, float)
    return np.concatenate(np.broadcast_arrays(np.asarray(position, float), scaled), axis=-1)


def from_configuration_vector(vector: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return position (..., 3), approach (..., 3), roll (...) = π ln‖w₂‖ of a configuration
    vector (..., 6).
    """
    vector = np.asarray(vector, float)
    length = np.linalg.norm(vector[..., 3:], axis=-1)
    if np.any(length == 0.0):
        raise InputError("bad-rotation", "a configuration vector needs an approach vector that is not zero")
    return vector[..., :3], vector[..., 3:] / length[..., None], np.asarray(np.pi * np.log(length))


def orientation_names(arm: Arm) -> tuple[str, ...]:
    """Return the names of what a target may give beside x, y, z, one for each number."""
    return ("phi", "theta", "eta") if arm.orientation == ("rpy",) else arm.orientation


def orientation_matrix(arm: Arm, position: ArrayLike, values: ArrayLike) -> Floats:
    """Return the rotations (..., 3, 3) of targets at positions (..., 3) with the values (..., k).

    `rpy` is Rot(z, φ) Rot(y, θ) Rot(x, η). Arms with fewer joints have the angle `roll` about the approach,
    and the RV-M1 before it the `pitch` of the approach above the horizontal; the rest follows from the
    position.
    """
    names, given = orientation_names(arm), np.asarray(values, float)
    if given.shape[-1:] != (len(names),):
        wanted = ", ".join(names) or "nothing"
        raise InputError(
            "wrong-count",
            f"{arm.name} takes {wanted} besides x, y, z, not {given.size} values",
            hint="angles in degrees",
        )
    angles = np.moveaxis(given, -1, 0)
    if arm.orientation == ("rpy",):
        return np.asarray(rot("z", angles[0]) @ rot("y", angles[1]) @ rot("x", angles[2]))
    if arm.closed_form == "scara":
        return np.asarray(rot("z", angles[0]) @ rot("x", np.pi))
    x, y, z = np.moveaxis(np.asarray(position, float), -1, 0)
    out = np.hypot(x, y)
    # The orientation that the arm has with these joints; those that do not affect it stay at home.
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
