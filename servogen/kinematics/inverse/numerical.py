"""Inverse kinematics by iteration, for any arm: damped least squares with hard limits and several starts.

In: an `Arm` and targets (m, 3) with or without orientations (m, 3, 3). Out: the best joint positions found
(m, n) and the distance of their tool from the target. All targets are solved together, each with its own
damping (Levenberg–Marquardt): a step that increases the error is not taken.

A joint at a limit that the step would push beyond it is omitted from the step, so the others can still move
along the limit. For a target that cannot be reached the result is therefore a nearest reachable point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servogen.kinematics.forward import fk
from servogen.kinematics.jacobian import with_pose
from servogen.kinematics.orientation import rotation_vector
from servogen.kinematics.transforms import Floats, wrapped
from servogen.robot.model import Arm

ITERATIONS = 60
"""The maximum number of steps from one start."""
SOME_ITERATIONS, ARRIVING = 25, 0.01
"""The number of steps after which a descent that will arrive is within this (metres, radians)."""
FEW_ITERATIONS = 15
"""The number of steps for joint positions that are nearly right."""
STARTS = 40
"""The number of starts, after which a target counts as unreachable."""
BATCH = 512
"""The number of simultaneous descents when only few targets are left."""
BEND = 0.1
"""The part of a step at which its curvature is measured."""
BENT = 1e-5
"""Half of the radians or metres over which the curvature of a distance is measured."""
STILL = 1e-10
"""A step shorter than this (radians, metres) is the last: Newton's next one would be rounding."""
ROUND, ROUNDS = 128, 8
"""The random starts in which a new solution is looked for, and the maximum number of such rounds."""
MOST = 16
"""The maximum number of isolated solutions of six joints, after Primrose, "On the input-output equation of
the general 7R mechanism" (Mechanism and Machine Theory 21, 1986). More are a few of infinitely many.
"""
APART = 1e-4
"""Solutions whose joints all differ by less than this (radians, metres) are one, found twice: where the arm
is singular, descents stop at different places beside it.
"""
SEED = 1984
"""The seed of the random starts: the same targets give the same answers."""


@dataclass(frozen=True, slots=True)
class NumericalSolution:
    """Joint positions (m, n) within the limits, and their distance (m,) and angle (m,) from the target."""

    q: Floats
    distance_m: Floats
    angle: Floats

    def within(self, tolerance: float) -> NDArray[np.bool_]:
        """Return which targets are met, to `tolerance` metres and radians."""
        return np.asarray((self.distance_m <= tolerance) & (self.angle <= tolerance))


def limits(arm: Arm) -> tuple[Floats, Floats]:
    """Return the lower and upper limits (n,)."""
    return np.array([joint.lower for joint in arm.joints]), np.array([joint.upper for joint in arm.joints])


def search(
    arm: Arm,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    near: ArrayLike | None = None,
    tolerance: float = 1e-10,
    starts: int = STARTS,
) -> NumericalSolution:
    """Return the best of several starts for each target: `near` or home first, then random ones.

    Joints that do not affect the targets (a last roll, without an orientation) stay where they start.
    """
    position = np.atleast_2d(np.asarray(position, float))
    rotation = None if rotation is None else np.asarray(rotation, float).reshape(-1, 3, 3)
    count = len(position)
    lower, upper = limits(arm)
    random = np.random.default_rng(SEED)
    first = np.clip(arm.home if near is None else np.asarray(near, float), lower, upper)
    start = np.broadcast_to(first, (count, len(lower)))
    idle = _idle(arm, rotation is not None)
    best = np.array(start)
    best_error = np.full((2, count), np.inf)
    open_ = np.arange(count)
    left = starts
    while left > 0 and len(open_):
        # The first start for all; then, for those still open, as many at a time as fill a batch
        starts_at_once = 1 if left == starts else min(left, max(1, BATCH // len(open_)))
        left -= starts_at_once
        which = np.repeat(open_, starts_at_once)
        guess = np.array(start[which])
        # From the second batch on the starts are random; joints without effect stay at the first start.
        if left < starts - 1:
            spread = random.uniform(lower, upper, guess.shape)
            guess[:, ~idle] = spread[:, ~idle]
        turn = None if rotation is None else rotation[which]
        q = descend(arm, guess, position[which], turn, tolerance)
        error = _errors(arm, q, position[which], turn)
        first = np.argmin(error.sum(axis=0).reshape(-1, starts_at_once), axis=1) + starts_at_once * np.arange(
            len(open_)
        )
        q, error = q[first], error[:, first]
        better = error.sum(axis=0) < best_error[:, open_].sum(axis=0)
        best[open_[better]] = q[better]
        best_error[:, open_[better]] = error[:, better]
        open_ = open_[~(best_error[:, open_] <= tolerance).all(axis=0)]
    return NumericalSolution(best, best_error[0], best_error[1])


def isolated(arm: Arm, oriented: bool) -> bool:
    """Return whether an arm has no more joints than a target determines, so that solutions are isolated."""
    return len(arm.joints) <= (6 if oriented else 3)


def every(arm: Arm, position: Floats, rotation: Floats | None, near: ArrayLike, tolerance: float) -> Floats:
    """Return the solutions (k, n) within the limits of one target, of an arm whose solutions are isolated.

    Descents from `near` and from rounds of random starts, until a round meets no solution that is new. The
    descents ignore the limits of turning joints: a limit in the way stops many that would arrive within it.
    """
    lower, upper = limits(arm)
    turning = np.array([joint.turning for joint in arm.joints])
    middle = (lower + upper) / 2
    low, high = np.where(turning, middle - np.pi, lower), np.where(turning, middle + np.pi, upper)
    wide = replace(
        arm,
        joints=tuple(
            replace(joint, lower=least, upper=most)
            for joint, least, most in zip(arm.joints, low.tolist(), high.tolist(), strict=True)
        ),
    )
    random = np.random.default_rng(SEED)
    met = np.empty((0, len(lower)))
    starts = np.asarray(near, float)[None]
    for _ in range(ROUNDS):
        starts = np.vstack([starts, random.uniform(low, high, (ROUND, len(low)))])
        q, known = _meeting(wide, starts, position, rotation, tolerance), len(met)
        for one in q:
            between = np.where(turning, wrapped(met - one), met - one)
            if (np.abs(between).max(axis=1) > APART).all():
                met = np.vstack([met, one])
        if len(met) == known:
            break
        if len(met) > MOST:
            met = met[: MOST + 1]
            break
        starts = starts[:0]
    within = met[((met > lower - APART) & (met < upper + APART)).all(axis=1)]
    return _meeting(arm, np.clip(within, lower, upper), position, rotation, tolerance)


def _meeting(arm: Arm, starts: Floats, position: Floats, rotation: Floats | None, tolerance: float) -> Floats:
    """Return the ends of the descents from `starts` (k, n) that meet the target.

    Nearly all that will arrive are close after a few steps; only those take more.
    """
    q = starts
    for iterations, limit in ((SOME_ITERATIONS, ARRIVING), (ITERATIONS, tolerance)):
        if not len(q):
            break
        places = np.broadcast_to(position, (len(q), 3))
        turns = None if rotation is None else np.broadcast_to(rotation, (len(q), 3, 3))
        q = descend(arm, q, places, turns, 1e-10, iterations)
        q = q[(_errors(arm, q, places, turns) <= limit).all(axis=0)]
    return q


def improved(
    arm: Arm, q: Floats, position: Floats, rotation: Floats | None, tolerance: float = 1e-10
) -> Floats:
    """Return joint positions (m, n) that have descended towards their targets, within the limits."""
    return descend(arm, q, position, rotation, tolerance, FEW_ITERATIONS)


def _idle(arm: Arm, oriented: bool) -> NDArray[np.bool_]:
    """Return which joints do not affect the targets, at any of a few configurations."""
    lower, upper = limits(arm)
    # Eight random configurations: a joint without effect at all of them has none anywhere.
    some = np.random.default_rng(SEED).uniform(lower, upper, (8, len(lower)))
    matrix = with_pose(arm, some)[0][:, : 6 if oriented else 3]
    return np.asarray(np.abs(matrix).max(axis=(0, 1)) < 1e-12)


def _errors(arm: Arm, q: Floats, position: Floats, rotation: Floats | None) -> Floats:
    pose = fk(arm, q)
    distance = np.linalg.norm(pose[:, :3, 3] - position, axis=1)
    if rotation is None:
        return np.stack([distance, np.zeros_like(distance)])
    turn = rotation_vector(rotation @ np.swapaxes(pose[:, :3, :3], 1, 2))
    return np.stack([distance, np.linalg.norm(turn, axis=1)])


def arm_size(arm: Arm) -> float:
    """Return the length, about the size of the arm, by which an angle of one radian is weighted."""
    lengths = arm.length
    fixed = sum(abs(row.d.value(lengths)) + abs(row.a.value(lengths)) for row in arm.rows)
    sliding = sum(joint.upper - joint.lower for joint in arm.joints if not joint.turning)
    return max(fixed + sliding, 1e-3)


class _Task:
    """Errors (m, k) and Jacobians (m, k, n) in metres: angles are weighted by the arm's size."""

    def __init__(self, arm: Arm, position: Floats, rotation: Floats | None) -> None:
        self.arm, self.position, self.rotation, self.weight = arm, position, rotation, 0.5 * arm_size(arm)

    def at(self, q: Floats, which: NDArray[np.intp]) -> tuple[Floats, Floats]:
        """Return the errors (m, k) and Jacobians (m, k, n) of the targets `which` at positions `q` (m, n)."""
        matrix, pose = with_pose(self.arm, q)
        error = self.position[which] - pose[:, :3, 3]
        if self.rotation is None:
            return error, matrix[:, :3]
        turn = rotation_vector(self.rotation[which] @ np.swapaxes(pose[:, :3, :3], 1, 2))
        matrix[:, 3:] *= self.weight
        return np.concatenate([error, self.weight * turn], axis=1), matrix


def descend(
    arm: Arm,
    q: Floats,
    position: Floats,
    rotation: Floats | None,
    tolerance: float,
    iterations: int = ITERATIONS,
) -> Floats:
    """Return `q` after Levenberg–Marquardt steps, until each target is met or no step reduces its error."""
    lower, upper = limits(arm)
    # A joint with a full turn or more is not held at its limits: it can go on in the next turn.
    free = np.array([joint.turning for joint in arm.joints]) & (upper - lower >= 2 * np.pi - 1e-9)
    low, high = np.where(free, -np.inf, lower), np.where(free, np.inf, upper)
    task, result = _Task(arm, position, rotation), np.array(q)
    which, q = np.arange(len(q)), np.array(q)
    error, matrix = task.at(q, which)
    cost = np.einsum("ij,ij->i", error, error)
    damping = np.full(len(q), 1e-2)
    for _ in range(iterations):
        # Below the tolerance by a factor of ten the target is met; with so much damping no step is left that
        # helps.
        going = (cost > (0.1 * tolerance) ** 2) & (damping < 1e8)
        result[which[~going]] = q[~going]
        which, q, error, matrix, cost, damping = (
            array[going] for array in (which, q, error, matrix, cost, damping)
        )
        if not len(which):
            break
        step = _Step(q, error, matrix, damping * np.minimum(cost, 1.0), low, high)
        straight = step.towards(error)
        # Second order: how the path bends along the step, from one more error on it
        ahead = task.at(q + BEND * straight, which)[0]
        bend = (2 / BEND) * ((error - ahead) / BEND - np.einsum("ijk,ik->ij", matrix, straight))
        curve = -0.5 * step.towards(bend)
        # The correction is used only where it is less than half of the step: beyond that the expansion does
        # not hold.
        small = np.einsum("ij,ij->i", curve, curve) < 0.25 * np.einsum("ij,ij->i", straight, straight)
        trial = np.clip(q + straight + np.where(small[:, None], curve, 0.0), low, high)
        new_error, new_matrix = task.at(trial, which)
        new_cost = np.einsum("ij,ij->i", new_error, new_error)
        # Rounding alone does not count as an improvement.
        good = new_cost < cost * (1 - 1e-12)
        q[good], error[good], matrix[good], cost[good] = (
            trial[good],
            new_error[good],
            new_matrix[good],
            new_cost[good],
        )
        damping = np.where(good, damping * 0.2, damping * 8.0)
    result[which] = q
    middle = (lower + upper) / 2
    return np.asarray(np.where(free, np.clip(middle + wrapped(result - middle), lower, upper), result))


def nearest(arm: Arm, q: Floats, position: Floats) -> Floats:
    """Return `q` (m, n) moved to the nearest local minimum of the distance from a point (3,), by Newton.

    `descend` neglects how the path bends, which is what counts where the distance does not become 0.
    """
    lower, upper = limits(arm)
    count = len(lower)
    offsets = BENT * np.vstack([np.eye(count), -np.eye(count)])

    def slope(at: Floats) -> tuple[Floats, Floats]:
        """Return half of the squared distances (...,) and their gradients (..., n)."""
        matrix, pose = with_pose(arm, at)
        error = pose[..., :3, 3] - position
        return 0.5 * np.einsum("...i,...i->...", error, error), np.einsum(
            "...ij,...i->...j", matrix[..., :3, :], error
        )

    q, damping = np.array(q), np.full(len(q), 1e-9)
    cost, gradient = slope(q)
    for _ in range(ITERATIONS):
        ahead, behind = np.split(slope(q[:, None, :] + offsets)[1], 2, axis=1)
        curvature = (ahead - behind) / (2 * BENT)
        stuck = ((q <= lower) & (gradient > 0)) | ((q >= upper) & (gradient < 0))
        curvature = np.where(stuck[:, :, None] | stuck[:, None, :], 0.0, curvature)
        values, axes = np.linalg.eigh((curvature + np.swapaxes(curvature, 1, 2)) / 2)
        # Along an axis along which the distance has a maximum the step leads away from it, too.
        along = np.einsum("ijk,ij->ik", axes, np.where(stuck, 0.0, gradient))
        step = -np.einsum("ijk,ik->ij", axes, along / (np.abs(values) + damping[:, None]))
        trial = np.clip(q + np.where(stuck, 0.0, step), lower, upper)
        if np.abs(trial - q).max() < STILL:
            break
        new_cost, new_gradient = slope(trial)
        good = new_cost < cost
        q[good], cost[good], gradient[good] = trial[good], new_cost[good], new_gradient[good]
        damping = np.where(good, damping * 0.1, np.maximum(damping, 1e-9) * 10.0)
    return q


class _Step:
    """(JᵀJ + λI)⁻¹ Jᵀ, without the joints at a limit that would be pushed beyond it."""

    def __init__(
        self, q: Floats, error: Floats, matrix: Floats, damping: Floats, low: Floats, high: Floats
    ) -> None:
        gradient = np.einsum("ijk,ij->ik", matrix, error)
        # The gradient points where the step would go, so this joint would leave its limits.
        stuck = ((q <= low) & (gradient < 0)) | ((q >= high) & (gradient > 0))
        self.matrix = np.where(stuck[:, None, :], 0.0, matrix)
        square = np.swapaxes(self.matrix, 1, 2) @ self.matrix
        diagonal = np.arange(q.shape[1])
        # The small constant keeps the matrix invertible where all joints are stuck or idle.
        square[:, diagonal, diagonal] += damping[:, None] + 1e-15
        self.inverse = np.linalg.inv(square)

    def towards(self, error: Floats) -> Floats:
        """Return the step (m, n) that removes the errors (m, k)."""
        gradient = np.einsum("ijk,ij->ik", self.matrix, error)
        return np.asarray((self.inverse @ gradient[..., None])[..., 0])
