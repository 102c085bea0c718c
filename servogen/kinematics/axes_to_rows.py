"""From joint axes to Denavit–Hartenberg rows (standard), and to the arm they make.

In: the axes of the joints at position zero, in the base's frame, and the tool's pose there. Out: an `Arm`
with base, rows and tool, whose forward kinematics is that of the axes.

        z_{k-1}            z_k is the axis of joint k+1. Origin k is where z_k meets z_{k-1}, or where their
          │   a_k          common normal meets it; x_k goes along the normal, away from z_{k-1}.
      b_k ├───────▶ x_k    b_k is where x_k meets z_{k-1}:
          │      o_k         θ_k from x_{k-1} to x_k about z_{k-1}     d_k from o_{k-1} to b_k along z_{k-1}
      o_{k-1}                a_k from b_k to o_k along x_k             α_k from z_{k-1} to z_k about x_k

Decided where the normal is free: parallel axes take the one through the previous origin (d = 0); collinear
ones keep the previous frame; in both cases the last frame stands at the tool. Axes that meet take the x_k
that is nearer to x_{k-1}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.orientation import to_angles
from servogen.kinematics.transforms import Floats, inverse, transform
from servogen.robot.model import Arm, DHRow, Frame, Joint, Length

SAME_M = 1e-9
"""Points nearer than this are equal; directions with a smaller cross product are parallel."""


@dataclass(frozen=True, slots=True)
class JointAxis:
    """An axis at position zero: a point on it and its direction. `joint` and `ratio` as in `DHRow`."""

    point: tuple[float, float, float]
    direction: tuple[float, float, float]
    joint: int
    ratio: float = 1.0
    offset: float = 0.0


def arm_of_axes(name: str, joints: Sequence[Joint], axes: Sequence[JointAxis], tool: ArrayLike) -> Arm:
    """Return the arm whose joints turn about or slide along `axes`, and whose tool is at `tool` (4, 4) at
    zero.
    """
    if not axes:
        raise InputError("wrong-robot-kind", f"'{name}' has no joints that move")
    lines = [(np.asarray(axis.point, float), _unit(axis.direction)) for axis in axes]
    tool = np.asarray(tool, float)
    frame = _next_frame(np.eye(4), *lines[0])
    base, rows = frame_of(frame), []
    lines.append((tool[:3, 3], tool[:3, 2]))
    for index, (axis, (point, direction)) in enumerate(zip(axes, lines[1:], strict=True), 1):
        following = _next_frame(frame, point, direction, last=index == len(axes))
        rows.append(_row(frame, following, axis, joints[axis.joint].turning))
        frame = following
    rest = frame_of(inverse(frame) @ tool)
    return Arm(name, "", "standard", tuple(joints), tuple(rows), base=base, tool=rest)


def frame_of(matrix: Floats) -> Frame:
    """Return a transform as a fixed frame; values below a nanometre or nanoradian become 0."""
    rz, ry, rx = to_angles(matrix[:3, :3], "ZYX")
    values = (*matrix[:3, 3], rx, ry, rz)
    return Frame(*(0.0 if abs(value) < 1e-12 else float(value) for value in values))


def _unit(direction: Sequence[float]) -> Floats:
    vector = np.asarray(direction, float)
    length = np.linalg.norm(vector)
    if length == 0.0:
        raise InputError("bad-rotation", "the axis of a joint has no direction (0, 0, 0)")
    return np.asarray(vector / length)


def _next_frame(frame: Floats, point: Floats, z: Floats, last: bool = False) -> Floats:
    """Return frame k on the line through `point` along `z`, from frame k-1; `last`: at the tool, if that is
    free.
    """
    x_before, z_before, origin = frame[:3, 0], frame[:3, 2], frame[:3, 3]
    across = np.cross(z_before, z)
    sine = float(np.linalg.norm(across))
    if sine > SAME_M:
        # feet of the common normal: along z from `point` by t
        t = np.dot(np.cross(point - origin, z_before), across) / sine**2
        foot = point + t * z
        between = np.dot(foot - origin, across) / sine
        x = across / sine
        if abs(between) > SAME_M:
            x = x * np.sign(between)
        elif np.dot(x, x_before) < 0:
            x = -x
    else:
        start = origin + np.dot(point - origin, z_before) * z_before if last else origin
        foot = point + np.dot(start - point, z) * z
        away = foot - start
        distance = float(np.linalg.norm(away))
        x = away / distance if distance > SAME_M else x_before
    x = x - np.dot(x, z) * z
    x = x / np.linalg.norm(x)
    return transform(np.stack([x, np.cross(z, x), z], axis=-1), foot)


def _row(before: Floats, after: Floats, axis: JointAxis, turning: bool) -> DHRow:
    seen = inverse(before) @ after
    theta = float(np.arctan2(seen[1, 0], seen[0, 0]))
    d = float(seen[2, 3])
    a = float(np.dot(after[:3, 3] - before[:3, 3] - d * before[:3, 2], after[:3, 0]))
    alpha = float(np.arctan2(np.dot(np.cross(before[:3, 2], after[:3, 2]), after[:3, 0]), seen[2, 2]))
    theta, d = (theta + axis.offset, d) if turning else (theta, d + axis.offset)
    return DHRow(_clean(theta), _length(d), _length(a), _clean(alpha), axis.joint, axis.ratio)


def _clean(value: float) -> float:
    return 0.0 if abs(value) < 1e-12 else value


def _length(value: float) -> Length:
    return Length((), _clean(value))
