"""Jacobians of an `Arm`, singular configurations, manipulability and static torques.

In: joint positions (..., n). Out: arrays (..., 6, n); the upper three rows are m/s, the lower three rad/s.

    turning joint   ┌ z × (p_n - p) ┐      sliding joint   ┌ z ┐      z, p: the joint's axis (frame i-1 in
                    └       z       ┘                      └ 0 ┘      standard DH, frame i in modified)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count, islice
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError, Location
from servogen.kinematics.forward import link_frames, row_axes
from servogen.kinematics.orientation import to_angles
from servogen.kinematics.transforms import AXES, Floats, inverse, rot, skew
from servogen.robot.model import Arm

FrameName = int | Literal["n"]
"""A frame: 0 is the base, 1 … the frame after that row, "n" the tool."""

SINGULAR = 1e-9
"""A singular value below this part of the largest counts as zero."""

BESIDE = 1e-4
"""How far (radians, metres) beside a singular configuration its lost directions are looked for."""


def with_pose(arm: Arm, q: ArrayLike) -> tuple[Floats, Floats]:
    """Return the geometric Jacobian (..., 6, n) in the base's frame, and the tool's pose (..., 4, 4)."""
    axes, pose = row_axes(arm, q)
    jacobian = np.zeros((*pose.shape[:-2], 6, len(arm.joints)))
    for axis in axes:
        joint = axis.row.joint
        assert joint is not None
        if arm.joints[joint].turning:
            # `+=` and the ratio, because a row may follow a joint that moves another row too.
            lever = pose[..., :3, 3] - axis.point
            jacobian[..., :3, joint] += axis.row.ratio * _cross(axis.direction, lever)
            jacobian[..., 3:, joint] += axis.row.ratio * axis.direction
        else:
            jacobian[..., :3, joint] += axis.row.ratio * axis.direction
    return jacobian, pose


def _cross(a: Floats, b: Floats) -> Floats:
    """Return a × b by components, which is several times faster than numpy's own on long arrays."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def analytic_jacobian(arm: Arm, q: ArrayLike, order: str) -> Floats:
    """Return the matrix (6, n) from the joints' speeds to the rates of x, y, z and of three angles.

    The angles turn about a, R_a b and R_a R_b c, seen from the base: ω = [a, R_a b, R_a R_b c] (α', β', γ')ᵀ.
    Raises InputError where two of these axes are parallel.
    """
    matrix, pose = with_pose(arm, q)
    order = "zyx" if order.lower() == "rpy" else order.lower()
    first, second, _ = to_angles(pose[:3, :3], order)
    a, b, c = (np.eye(3)[AXES[axis]] for axis in order)
    turned = rot(order[0], first)
    axes = np.stack([a, turned @ b, turned @ rot(order[1], second) @ c], axis=-1)
    if abs(np.linalg.det(axes)) < SINGULAR:
        text = f"the {order} angles have no rates here: two of their axes are parallel"
        raise InputError("bad-option", text, Location(key="--analytic"), "other angles, such as zyz or zyx")
    return np.concatenate([matrix[:3], np.linalg.solve(axes, matrix[3:])])


def jacobian(arm: Arm, q: ArrayLike, frame: FrameName = 0) -> Floats:
    """Return the geometric Jacobian (..., 6, n), its rows in a frame: diag(ᵃR₀, ᵃR₀) J."""
    matrix, pose = with_pose(arm, q)
    if frame == 0:
        return matrix
    if frame == "n":
        turn = pose[..., :3, :3]
    elif isinstance(frame, int) and 0 < frame <= len(arm.rows):
        turn = link_frames(arm, q)[..., frame, :3, :3]
    else:
        raise InputError(
            "unknown-name",
            f"{arm.name} has no frame '{frame}'",
            hint=f"0 to {len(arm.rows)}, or n for the tool",
        )
    # The inverse of a rotation is its transpose.
    back = np.swapaxes(turn, -1, -2)
    return np.concatenate([back @ matrix[..., :3, :], back @ matrix[..., 3:, :]], axis=-2)


def manipulability(arm: Arm, q: ArrayLike) -> Floats:
    """Return Yoshikawa's measure (...) of the task: the product of as many singular values as its rank has
    elsewhere; 0 exactly where `singularity` finds one.

    The task's rows are those of the velocity if the arm's targets are positions, otherwise all six, whose
    units differ. For six joints it is |det J|.
    """
    matrix, result = jacobian(arm, q), np.array(1.0)
    for index, rows in enumerate(_tasks(arm)):
        values, full = np.linalg.svd(matrix[..., :rows, :], compute_uv=False), _general_rank(arm, rows)
        kept = np.where(values > SINGULAR * values.max(axis=-1, keepdims=True), values, 0.0)[..., :full]
        result = result * (np.prod(kept, axis=-1) if index == 0 else (kept > 0).all(axis=-1))
    return np.asarray(result)


def _tasks(arm: Arm) -> tuple[int, ...]:
    """Return the numbers of the Jacobian's first rows whose rank tells what an arm's target asks for.

    An orientation that follows in part from the position, as with five joints, hides the loss of a
    direction of the position in the rank of all rows, so these are examined, too.
    """
    return (6, 3) if arm.orientation else (3,)


@dataclass(frozen=True, slots=True)
class Singularity:
    """What the Jacobian's rows for the arm's task can do at one configuration, by their singular value
    decomposition.

    `lost` are the tool speeds (6,) that no joint speed makes, although beside this configuration one does;
    `idle` the joint speeds (n,) that do not move the tool (redundancy); both are unit vectors.
    """

    rank: int
    full_rank: int
    lost: tuple[tuple[float, ...], ...]
    idle: tuple[tuple[float, ...], ...]

    @property
    def singular(self) -> bool:
        """Return whether the rank is below the full rank."""
        return self.rank < self.full_rank


def singularity(arm: Arm, q: ArrayLike) -> Singularity:
    """Return whether the configuration q (n,) is singular, and which directions it loses.

    The full rank is the maximum over a few configurations that are far apart.
    """
    matrix = jacobian(arm, q)
    if matrix.ndim != 2:
        raise InputError("wrong-count", "one configuration at a time: give n joint positions")
    _, values, right = np.linalg.svd(matrix)
    idle, lost = right[_rank(values) :], np.zeros((0, 6))
    for rows in _tasks(arm):
        if not len(lost):
            lost = _lost_directions(arm, np.asarray(q, float), matrix[:rows])
    full = _general_rank(arm, _tasks(arm)[0])
    return Singularity(full - len(lost), full, _tuples(lost), _tuples(idle))


def _lost_directions(arm: Arm, q: Floats, matrix: Floats) -> Floats:
    """Return the directions (k, 6) that the rows of `matrix` (rows, n) lose at the joint positions q (n,).

    Beside q, what the joint speeds that stand still at q do becomes the lost directions. The other directions
    outside the range of `matrix` are those that the arm has nowhere.
    """
    rows = len(matrix)
    left, values, right = np.linalg.svd(matrix)
    rank = _rank(values)
    missing, number = left[:, rank:], _general_rank(arm, rows) - rank
    if number <= 0:
        return np.zeros((0, 6))
    aside = np.random.default_rng(0).uniform(-BESIDE, BESIDE, (4 * len(q), len(q)))
    beside = jacobian(arm, q + aside)[:, :rows] @ right[rank:].T
    shares = np.linalg.svd(np.concatenate(list(missing.T @ beside), axis=1))[0]
    lost = np.zeros((number, 6))
    lost[:, :rows] = (missing @ shares[:, :number]).T
    return lost


def _tuples(rows: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row.tolist()) for row in rows)


def _rank(values: Floats) -> int:
    # Relative to the largest value, which grows with the size of the arm.
    return int(np.sum(values > SINGULAR * values.max(initial=0.0)))


def _far_apart(arm: Arm) -> Floats:
    """Return eight configurations at irrational parts of the limits, so that none of them is special."""
    lower = np.array([joint.lower for joint in arm.joints])
    upper = np.array([joint.upper for joint in arm.joints])
    primes = (n for n in count(2) if all(n % divisor for divisor in range(2, math.isqrt(n) + 1)))
    parts = np.outer(np.arange(1, 9), np.sqrt([*islice(primes, len(lower))])) % 1.0
    return np.asarray(lower + parts * (upper - lower))


def _general_rank(arm: Arm, rows: int) -> int:
    values = np.linalg.svd(jacobian(arm, _far_apart(arm))[:, :rows], compute_uv=False)
    return max(_rank(value) for value in values)


def static_torques(arm: Arm, q: ArrayLike, force: ArrayLike, moment: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
    """Return joint loads τ = Jᵀ (F, M), shape (..., n), of a force (..., 3) N and moment (..., 3) N·m on the
    tool.

    Base's frame; N·m on turning joints, N on sliding ones. The motors must give the opposite to hold still.
    """
    wrench = np.concatenate(np.broadcast_arrays(np.asarray(force, float), np.asarray(moment, float)), axis=-1)
    return np.asarray((np.swapaxes(jacobian(arm, q), -1, -2) @ wrench[..., None])[..., 0])


def differential(d: ArrayLike, delta: ArrayLike) -> Floats:
    """Return Δ (..., 4, 4) of a small translation d (..., 3) and rotation δ (..., 3)."""
    d, delta = np.broadcast_arrays(np.asarray(d, float), np.asarray(delta, float))
    matrix = np.zeros((*d.shape[:-1], 4, 4))
    matrix[..., :3, :3] = skew(delta)
    matrix[..., :3, 3] = d
    return matrix


def change(frame: ArrayLike, d: ArrayLike, delta: ArrayLike) -> Floats:
    """Return dT = Δ T (..., 4, 4): how a frame changes by a motion about the fixed axes."""
    return np.asarray(differential(d, delta) @ np.asarray(frame, float))


def seen_from(frame: ArrayLike, d: ArrayLike, delta: ArrayLike) -> tuple[Floats, Floats]:
    """Return the same motion in the axes of T: ᵀd = (n, o, a)·(δ × p + d), ᵀδ = (δ·n, δ·o, δ·a), each (...,
    3).
    """
    frame, d, delta = (np.asarray(value, float) for value in (frame, d, delta))
    back = np.swapaxes(frame[..., :3, :3], -1, -2)
    moved = np.cross(delta, frame[..., :3, 3]) + d
    return np.asarray((back @ moved[..., None])[..., 0]), np.asarray((back @ delta[..., None])[..., 0])


def motion_of(matrix: ArrayLike, frame: ArrayLike) -> tuple[Floats, Floats]:
    """Return d and δ of a change dT of T: Δ = dT T⁻¹."""
    delta = np.asarray(matrix, float) @ inverse(frame)
    turned = np.stack([delta[..., 2, 1], delta[..., 0, 2], delta[..., 1, 0]], axis=-1)
    return np.asarray(delta[..., :3, 3]), turned
