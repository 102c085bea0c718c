"""Forward kinematics of an `Arm`: the pose of the tool from the joint positions, for many poses at once.

In: an `Arm` and joint positions (..., n), radians and metres. Out: transforms (..., 4, 4).

    standard (Paul)    A_i = Rot(z, θ_i) Trans(z, d_i) Trans(x, a_i) Rot(x, α_i)
    modified (Craig)   A_i = Rot(x, α_{i-1}) Trans(x, a_{i-1}) Rot(z, θ_i) Trans(z, d_i)

The product is not formed matrix by matrix. The three axes and the origin are kept as components, which are
arrays over the poses or plain numbers. Products with 0 or 1 are skipped, and angles about parallel axes are
added before one cosine and sine is taken, so that the calculation is the closed form of the robot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError
from servogen.kinematics.transforms import Floats, cos_sin, exact_cos_sin, frame_matrix
from servogen.robot.model import Arm, DHRow

Part = Floats | float
"""One component over all poses, or a number if it is the same for all."""
Vector = tuple[Part, Part, Part]

BLOCK = 16_384
"""The number of poses computed at a time, so that the components stay in the processor's cache."""


def joint_array(arm: Arm, q: ArrayLike) -> Floats:
    """Return joint positions as an array (..., n). Raises InputError for a wrong number of them."""
    try:
        array = np.asarray(q, float)
    except (TypeError, ValueError) as error:
        raise InputError("not-a-number", f"joint positions must be numbers: {error}") from error
    names = [joint.name for joint in arm.joints]
    if array.ndim == 0 or array.shape[-1] != len(names):
        count = 0 if array.ndim == 0 else array.shape[-1]
        raise InputError(
            "wrong-count", f"{arm.name} has {len(names)} joints, not {count}", hint=", ".join(names)
        )
    return array


def fk(arm: Arm, q: ArrayLike) -> Floats:
    """Return the tool's pose in the base's frame, shape (..., 4, 4), for joint positions (..., n)."""
    q = joint_array(arm, q)
    rows = q.reshape(-1, q.shape[-1])
    out = np.zeros((4, 4, len(rows)))  # components first: each is written in one piece
    out[3, 3] = 1.0
    for start in range(0, len(rows), BLOCK):
        part = slice(start, start + BLOCK)
        chain = whole_chain(arm, [rows[part, joint] for joint in range(rows.shape[1])])
        for column, vector in enumerate((*chain.axes(), chain.origin)):
            for line, component in enumerate(vector):
                out[line, column, part] = component
    return np.moveaxis(out, -1, 0).reshape(*q.shape[:-1], 4, 4)


def fk_position(arm: Arm, q: ArrayLike) -> Floats:
    """Return the tool's position alone, shape (..., 3)."""
    q = joint_array(arm, q)
    rows = q.reshape(-1, q.shape[-1])
    out = np.empty((3, len(rows)))
    for start in range(0, len(rows), BLOCK):
        part = slice(start, start + BLOCK)
        chain = whole_chain(arm, [rows[part, joint] for joint in range(rows.shape[1])])
        for line, component in enumerate(chain.origin):
            out[line, part] = component
    return np.moveaxis(out, 0, -1).reshape(*q.shape[:-1], 3)


@dataclass(frozen=True, slots=True)
class RowAxis:
    """The axis a DH row's variable acts along: unit vector and a point on it, (..., 3) each, base's frame."""

    row: DHRow
    direction: Floats
    point: Floats


def row_axes(arm: Arm, q: ArrayLike) -> tuple[tuple[RowAxis, ...], Floats]:
    """Return the axis of every row with a joint, and the tool's pose (..., 4, 4)."""
    q = joint_array(arm, q)
    lines = []
    joints = [q[..., joint] for joint in range(q.shape[-1])]
    chain = _start(arm)
    for row in arm.rows:
        direction, point = chain.advance(arm, row, joints)
        if row.joint is not None:
            lines.append(RowAxis(row, _as_array(direction, q.shape[:-1]), _as_array(point, q.shape[:-1])))
    chain.follow(frame_matrix(arm.tool))
    pose = np.zeros((*q.shape[:-1], 4, 4))
    for column, vector in enumerate((*chain.axes(), chain.origin)):
        pose[..., :3, column] = _as_array(vector, q.shape[:-1])
    pose[..., 3, 3] = 1.0
    return tuple(lines), pose


def link_frames(arm: Arm, q: ArrayLike) -> Floats:
    """Return the frames 0 (base) to n (last row) and the tool's, shape (..., rows + 2, 4, 4)."""
    q = joint_array(arm, q)
    frames = np.zeros((*q.shape[:-1], len(arm.rows) + 2, 4, 4))
    frames[..., 3, 3] = 1.0
    joints = [q[..., joint] for joint in range(q.shape[-1])]
    chain = _start(arm)
    for index in range(len(arm.rows) + 2):
        if index > len(arm.rows):
            chain.follow(frame_matrix(arm.tool))
        elif index > 0:
            chain.advance(arm, arm.rows[index - 1], joints)
        for column, vector in enumerate((*chain.axes(), chain.origin)):
            frames[..., index, :3, column] = _as_array(vector, q.shape[:-1])
    return frames


def whole_chain(arm: Arm, joints: list[Floats]) -> Chain:
    """Return the tool's frame after all rows, for `joints`, one array of positions per joint."""
    chain = _start(arm)
    for row in arm.rows:
        chain.advance(arm, row, joints)
    chain.follow(frame_matrix(arm.tool))
    return chain


def _start(arm: Arm) -> Chain:
    base = frame_matrix(arm.base).tolist()
    x, y, z, p = ((base[0][column], base[1][column], base[2][column]) for column in range(4))
    return Chain(x, y, z, p)


class Chain:
    """A frame on its way along the rows: axes x, y before the turn still to be made about z, z, origin."""

    def __init__(self, x: Vector, y: Vector, z: Vector, origin: Vector) -> None:
        self.x, self.y, self.z, self.origin = x, y, z, origin
        self.turn: Part = 0.0
        self._x_turned: Vector | None = None
        self._cos_sin: tuple[Part, Part] = (1.0, 0.0)

    def advance(self, arm: Arm, row: DHRow, joints: list[Floats]) -> tuple[Vector, Vector]:
        """Advance over one row; return the axis of its variable: direction and point."""
        lengths = arm.length
        turning = row.joint is not None and arm.joints[row.joint].turning
        moved: Part = 0.0 if row.joint is None else _times(joints[row.joint], row.ratio)
        theta: Part = _plus(moved, row.theta) if turning else row.theta
        d: Part = row.d.value(lengths) if turning else _plus(moved, row.d.value(lengths))
        a = row.a.value(lengths)
        if arm.convention == "modified":
            self._tilt(row.alpha)
            self._move_along_x(a)
            axis = (self.z, self.origin)
            self._screw_along_z(theta, d)
            return axis
        axis = (self.z, self.origin)
        self._screw_along_z(theta, d)
        self._move_along_x(a)
        self._tilt(row.alpha)
        return axis

    def _screw_along_z(self, theta: Part, d: Part) -> None:
        # The turn is only added up here: parallel axes share one cosine and sine.
        if not (isinstance(theta, float) and theta == 0.0):
            self.turn = _plus(self.turn, theta)
            self._cos_sin = _cos_sin(self.turn)
            self._x_turned = None
        self.origin = _vector_plus(self.origin, _vector_times(self.z, d))

    def _move_along_x(self, a: float) -> None:
        if a != 0.0:
            self.origin = _vector_plus(self.origin, _vector_times(self._turned_x(), a))

    def _turned_x(self) -> Vector:
        if self._x_turned is None:
            cosine, sine = self._cos_sin
            self._x_turned = _vector_plus(_vector_times(self.x, cosine), _vector_times(self.y, sine))
        return self._x_turned

    def _tilt(self, alpha: float) -> None:
        if alpha == 0.0:
            return
        # A tilt changes the axis of the turn, so the pending turn is made first.
        x, y, z = self.axes()
        cosine, sine = exact_cos_sin(alpha)
        self.x, self.turn, self._cos_sin, self._x_turned = x, 0.0, (1.0, 0.0), x
        self.y = _vector_plus(_vector_times(y, cosine), _vector_times(z, sine))
        self.z = _vector_plus(_vector_times(y, -sine), _vector_times(z, cosine))

    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Return x, y and z after the turn."""
        cosine, sine = self._cos_sin
        y = _vector_plus(_vector_times(self.x, _times(sine, -1.0)), _vector_times(self.y, cosine))
        return self._turned_x(), y, self.z

    def follow(self, frame: Floats) -> None:
        """Advance to a fixed frame, the tool's."""
        if np.array_equal(frame, np.eye(4)):
            return
        axes = self.axes()
        columns = []
        for column in range(4):
            vector: Vector = (0.0, 0.0, 0.0)
            for axis, factor in zip(axes, frame[:3, column].tolist(), strict=True):
                vector = _vector_plus(vector, _vector_times(axis, factor))
            columns.append(vector)
        self.origin = _vector_plus(self.origin, columns[3])
        self.x, self.y, self.z = columns[:3]
        self.turn, self._cos_sin, self._x_turned = 0.0, (1.0, 0.0), columns[0]


def _cos_sin(angle: Part) -> tuple[Part, Part]:
    return exact_cos_sin(angle) if isinstance(angle, float) else cos_sin(angle)


def _times(one: Part, two: Part) -> Part:
    # Factors of 0 and ±1, from right angles, keep a component a plain number instead of an array.
    for number, other in ((one, two), (two, one)):
        if isinstance(number, float):
            if number == 0.0:
                return 0.0
            if number == 1.0:
                return other
            if number == -1.0:
                return -other
    return one * two


def _plus(one: Part, two: Part) -> Part:
    if isinstance(one, float) and one == 0.0:
        return two
    if isinstance(two, float) and two == 0.0:
        return one
    return one + two


def _vector_times(vector: Vector, factor: Part) -> Vector:
    x, y, z = vector
    return _times(x, factor), _times(y, factor), _times(z, factor)


def _vector_plus(one: Vector, two: Vector) -> Vector:
    return _plus(one[0], two[0]), _plus(one[1], two[1]), _plus(one[2], two[2])


def _as_array(vector: Vector, shape: tuple[int, ...]) -> Floats:
    out = np.empty((*shape, 3))
    for index, component in enumerate(vector):
        out[..., index] = component
    return out
