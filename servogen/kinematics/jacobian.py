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

from servogen.errors import InputError
from servogen.kinematics.forward import link_frames, row_axes
from servogen.kinematics.orientation import rates_matrix, to_angles
from servogen.kinematics.transforms import Floats, inverse, skew
from servogen.robot.model import Arm

FrameName = int | Literal["n"]
"""A frame: 0 is the base, 1 … the frame after that row, "n" the tool."""

SINGULAR = 1e-9
"""A singular value below this part of the largest counts as zero."""


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


def analytic_jacobian(arm: Arm, q: ArrayLike, order: str = "ZYX") -> Floats:
    """Return the analytic Jacobian (..., 6, n): position rates, then the rates of the three angles of
    `order`.

    Its upper rows are the geometric ones; the lower are B⁻¹ J_ω. Raises InputError if B is singular.
    """
    matrix, pose = with_pose(arm, q)
    rates = rates_matrix(to_angles(pose[..., :3, :3], order), order)
    if np.any(np.abs(np.linalg.det(rates)) < SINGULAR):
        raise InputError(
            "bad-rotation",
            f"the angles {order} are singular at this pose: their rates are not determined",
            hint="take another order, or the geometric Jacobian",
        )
    lower = np.linalg.solve(rates, matrix[..., 3:, :])
    return np.concatenate([matrix[..., :3, :], lower], axis=-2)


def manipulability(arm: Arm, q: ArrayLike, rows: Literal["position", "all"] = "position") -> Floats:
    """Return Yoshikawa's measure: the product of the singular values of J; 0 if the arm is singular.

    For six joints or more it is √det(J Jᵀ). For an arm with fewer joints, `rows` selects the directions:
    "position" the upper three rows, "all" all six, whose units differ.
    """
    matrix = jacobian(arm, q)
    values = np.linalg.svd(matrix[..., :3, :] if rows == "position" else matrix, compute_uv=False)
    return np.asarray(np.prod(values, axis=-1))


@dataclass(frozen=True, slots=True)
class Singularity:
    """What the Jacobian can do at one configuration, by its singular value decomposition.

    `lost` are the tool speeds (6,) that no joint speed makes although another configuration of the arm could;
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
    left, values, right = np.linalg.svd(matrix)
    rank = _rank(values)
    full = _general_rank(arm)
    lost = _lost(arm, left[:, rank:], full - rank) if rank < full else np.zeros((0, 6))
    return Singularity(rank, full, _tuples(lost), _tuples(right[rank:]))


def _lost(arm: Arm, missing: Floats, number: int) -> Floats:
    """Return the `number` directions (number, 6) in the span of the columns of `missing` that the arm has
    elsewhere: with fewer than six joints it has some nowhere.
    """
    axes, values, _ = np.linalg.svd(jacobian(arm, _far_apart(arm)).swapaxes(0, 1).reshape(6, -1))
    possible = axes[:, : _rank(values)]
    shares = np.linalg.svd(possible.T @ missing)[2]
    return np.asarray(shares[:number] @ missing.T)


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


def _general_rank(arm: Arm) -> int:
    values = np.linalg.svd(jacobian(arm, _far_apart(arm)), compute_uv=False)
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


def cylindrical_jacobian(r: ArrayLike, alpha: ArrayLike) -> Floats:
    """Return J of (ẋ, ẏ, ż) = J (ṙ, α̇, ċ), shape (..., 3, 3)."""
    r, alpha = np.broadcast_arrays(np.asarray(r, float), np.asarray(alpha, float))
    cosine, sine = np.cos(alpha), np.sin(alpha)
    matrix = np.zeros((*r.shape, 3, 3))
    matrix[..., 0, 0], matrix[..., 0, 1] = cosine, -r * sine
    matrix[..., 1, 0], matrix[..., 1, 1] = sine, r * cosine
    matrix[..., 2, 2] = 1.0
    return matrix


def spherical_jacobian(r: ArrayLike, beta: ArrayLike, gamma: ArrayLike) -> Floats:
    """Return J of (ẋ, ẏ, ż) = J (ṙ, β̇, γ̇), shape (..., 3, 3); its last row is (cos β, -r sin β, 0)."""
    r, beta, gamma = np.broadcast_arrays(*(np.asarray(value, float) for value in (r, beta, gamma)))
    (cb, sb), (cg, sg) = (np.cos(beta), np.sin(beta)), (np.cos(gamma), np.sin(gamma))
    rows = [
        [sb * cg, r * cb * cg, -r * sb * sg],
        [sb * sg, r * cb * sg, r * sb * cg],
        [cb, -r * sb, np.zeros_like(r)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
