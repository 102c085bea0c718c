"""Inverse kinematics: all solutions of a target, within the limits, each checked by forward kinematics.

In: targets: positions (..., 3) in metres in the base's frame, with or without rotations (..., 3, 3).
Out: `Solutions`, or for one target its joint positions by the choice rule; `Unreachable` if there is none.

Conventions:
- `Solutions.q` gives a turning joint in the turn about the middle of its limits. A joint with a full turn of
  travel or more has further turns, or both ends of ±180°: `Solutions.near` and `every_turn` give those.
- Where infinitely many solutions exist (a target on the axis of a joint) the joint stays at home.
- Choice rule: the solution nearest to the present position (`near`, else home), by the sum of the squares of
  the joints' moves, each divided by its range; of equal ones the first in the order of the branches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servogen.errors import InputError
from servogen.kinematics.forward import fk, fk_position
from servogen.kinematics.inverse import numerical
from servogen.kinematics.inverse.checked_forms import (
    RIGHT_HANDED,
    TOLERANCE,
    closed_solutions,
    has_closed_form,
)
from servogen.kinematics.inverse.closed_forms import wrist_joints
from servogen.kinematics.inverse.numerical import limits
from servogen.kinematics.inverse.unreachable import Unreachable
from servogen.kinematics.jacobian import jacobian
from servogen.kinematics.orientation import orientation_matrix
from servogen.kinematics.transforms import Floats, is_rotation, wrapped
from servogen.robot.model import Arm

NUMERICAL_TOLERANCE = 1e-7
"""The tolerance of the numerical method, which converges slowly where the arm is nearly singular."""

FEW_STARTS = 8
"""The starts after which every solution of a target is looked for."""

TYPED_M = 1e-5
"""How far a typed target may be from the surface that an arm with few joints reaches: the digits left out."""

TURN = 2 * np.pi

SAME = 1e-7
"""Solutions whose joints all differ by less than this (radians, metres) count once."""


FREE, NEARLY_SINGULAR = 1e-3, 1e-6
"""The step (radians, metres) by which a joint is moved to see whether it is free, where singular values are
below this part of the largest.
"""

MAX_LISTED = 10_000
"""The maximum number of solutions of one target; each joint multiplies them by its turns."""


@dataclass(frozen=True, slots=True)
class Solutions:
    """Candidates of many targets: `q` (..., branches, n), NaN in every joint of a branch that has none."""

    arm: Arm
    q: Floats

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Return which branches are solutions, shape (..., branches)."""
        return ~np.isnan(self.q[..., 0])

    def near(self, reference: ArrayLike) -> Floats:
        """Return the branches (..., branches, n) with each joint in the nearest turn within its limits."""
        lower, upper = limits(self.arm)
        least, most = self._turns()
        wanted = np.rint((np.asarray(reference, float)[..., None, :] - self.q) / TURN)
        # q itself is within the limits even where rounding says that no turn of it is
        turns = np.clip(wanted, np.minimum(least, 0.0), np.maximum(most, 0.0))
        return np.asarray(np.clip(self.q + TURN * turns, lower, upper))

    def every_turn(self) -> Floats:
        """Return all solutions (k, n) of one target in every turn. Raises InputError for more than 10,000."""
        lower, upper = limits(self.arm)
        least, most = self._turns()
        solutions: list[Floats] = []
        for row, first, last in zip(self.q, np.minimum(least, 0.0), np.maximum(most, 0.0), strict=True):
            if np.isnan(row[0]):
                continue
            count = float(np.prod(last - first + 1))
            if len(solutions) + count > MAX_LISTED:
                raise InputError(
                    "out-of-reach",
                    f"{self.arm.name} reaches this target in more than {MAX_LISTED} ways: "
                    "its joints have so many turns of travel",
                    hint="narrow the limits of its joints",
                )
            turns = [np.arange(low, high + 1) for low, high in zip(first, last, strict=True)]
            solutions += [
                np.clip(row + TURN * np.array(whole_turns), lower, upper) for whole_turns in product(*turns)
            ]
        return np.array(solutions).reshape(-1, len(lower))

    def choose(self, near: ArrayLike | None = None) -> Floats:
        """Return the solution of each target by the choice rule, shape (..., n); NaN for none."""
        reference = np.asarray(self.arm.home if near is None else near, float)
        lower, upper = limits(self.arm)
        q = self.near(reference)
        # Divided by the ranges, radians and metres can be added.
        moves = (q - reference[..., None, :]) / (upper - lower)
        away = np.einsum("...ij,...ij->...i", moves, moves)
        # Rounded, so that the first of equal branches is taken on every machine.
        best = np.argmin(np.where(np.isnan(away), np.inf, np.round(away, 12)), axis=-1)
        return np.take_along_axis(q, best[..., None, None], axis=-2)[..., 0, :]

    def _turns(self) -> tuple[Floats, Floats]:
        """Return the smallest and largest number of turns that can be added to each joint of `q` within its
        limits.
        """
        lower, upper = limits(self.arm)
        turning = np.array([joint.turning for joint in self.arm.joints])
        least = np.ceil((lower - TOLERANCE - self.q) / TURN)
        most = np.floor((upper + TOLERANCE - self.q) / TURN)
        return np.where(turning, least, 0.0), np.where(turning, most, 0.0)


def solve(
    arm: Arm,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    tolerance: float | None = None,
    near: ArrayLike | None = None,
) -> Solutions:
    """Return all solutions of all targets in closed form.

    Without a closed form, the numerical method gives one; it searches from `near` (else home) first. What a
    few starts do not meet is given up only after every solution was looked for.
    """
    position, rotation = _check_target(position, rotation)
    shape = position.shape[:-1]
    flat = position.reshape(-1, 3)
    turns = None if rotation is None else np.broadcast_to(rotation, (*shape, 3, 3)).reshape(-1, 3, 3)
    if has_closed_form(arm, rotation is not None):
        q = closed_solutions(arm, flat, turns, TOLERANCE if tolerance is None else tolerance, hard=True)
    else:
        start = np.broadcast_to(arm.home if near is None else near, (*shape, len(arm.joints)))
        start = start.reshape(-1, len(arm.joints))
        isolated = numerical.isolated(arm, turns is not None)
        approached = numerical.search(
            arm, flat, turns, start, starts=FEW_STARTS if isolated else numerical.STARTS
        )
        met = approached.within(tolerance or NUMERICAL_TOLERANCE)
        q = np.where(met[:, None], approached.q, np.nan)
        for index in np.flatnonzero(~met) if isolated else ():
            found = _numerical(arm, flat[index], None if turns is None else turns[index], start[index])
            if len(found):
                q[index] = Solutions(arm, found).choose(start[index])
        q = q[:, None, :]
    return Solutions(arm, q.reshape(*shape, *q.shape[1:]))


def solutions_near(arm: Arm, position: ArrayLike, rotation: ArrayLike | None, near: ArrayLike) -> Floats:
    """Return the solutions (m, branches, n) of targets (m, 3), each in the turn nearest to `near` (m, n).

    Without a closed form, the result of a numerical search from `near` is the only one, if it meets the
    target.
    """
    position, rotation = _check_target(position, rotation)
    if has_closed_form(arm, rotation is not None):
        return solve(arm, position, rotation).near(near)
    start = np.asarray(near, float)
    approached = numerical.search(arm, position, rotation, start, starts=1)
    q = np.where(approached.within(NUMERICAL_TOLERANCE)[:, None], approached.q, np.nan)[:, None, :]
    return Solutions(arm, q).near(start)


def ik(
    arm: Arm, position: ArrayLike, rotation: ArrayLike | None = None, near: ArrayLike | None = None
) -> Floats:
    """Return joint positions (..., n) by the choice rule. Raises `Unreachable` for the first target without
    one.
    """
    q = solve(arm, position, rotation, near=near).choose(near)
    lost = np.isnan(q[..., 0])
    if lost.any():
        index = tuple(int(indices[0]) for indices in np.nonzero(np.atleast_1d(lost)))[: lost.ndim]
        turns = (
            None if rotation is None else np.broadcast_to(np.asarray(rotation, float), (*lost.shape, 3, 3))
        )
        raise why_unreachable(
            arm, np.asarray(position, float)[index], None if turns is None else turns[index]
        )
    return q


def ik_typed(
    arm: Arm, position: ArrayLike, angles: ArrayLike | None = None, near: ArrayLike | None = None
) -> tuple[Floats, float]:
    """Return what `ik_all` does for a typed target, and how far (metres) the solutions are from it.

    The target may be `TYPED_M` beyond what the arm reaches. `angles` are its orientation as in
    `orientation_matrix`. Raises `Unreachable`, InputError.
    """

    def turn(point: ArrayLike) -> Floats | None:
        return None if angles is None else orientation_matrix(arm, point, angles)

    try:
        return ik_all(arm, position, turn(position), near), 0.0
    except Unreachable as error:
        missed = float(np.linalg.norm(np.asarray(position, float) - error.nearest))
        if missed > TYPED_M:
            raise
        try:
            return ik_all(arm, error.nearest, turn(error.nearest), near, NUMERICAL_TOLERANCE), missed
        except Unreachable:
            raise error from None


def ik_all(
    arm: Arm,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    near: ArrayLike | None = None,
    tolerance: float | None = None,
) -> Floats:
    """Return all solutions (k, n) of one target in every turn, the chosen one first.

    Raises `Unreachable` if there is none.
    """
    target, turn = _check_target(position, rotation)
    if target.ndim != 1:
        raise InputError("wrong-count", "one target at a time: give x, y, z")
    if has_closed_form(arm, turn is not None):
        solutions = solve(arm, target, turn, tolerance)
    else:
        solutions = Solutions(arm, _numerical(arm, target, turn, arm.home if near is None else near))
    q = solutions.every_turn()
    if not len(q):
        raise why_unreachable(arm, target, turn)
    return sorted_without_doubles(arm, q, near)


def _numerical(arm: Arm, target: Floats, turn: Floats | None, near: ArrayLike) -> Floats:
    """Return the solutions (k, n) of one target that many starts find."""
    if numerical.isolated(arm, turn is not None):
        return numerical.every(arm, target, turn, near, NUMERICAL_TOLERANCE)
    starts = np.vstack([np.asarray(near, float), _spread(arm, 31)])
    turns = None if turn is None else np.broadcast_to(turn, (len(starts), 3, 3))
    met = numerical.search(arm, np.broadcast_to(target, (len(starts), 3)), turns, starts, starts=1)
    return np.asarray(met.q[met.within(NUMERICAL_TOLERANCE)])


def free_joints(arm: Arm, solutions: Floats, oriented: bool) -> tuple[str, ...]:
    """Return the joints that can move while the tool stays where it is, at one of `solutions` (k, n).

    Then there are infinitely many solutions, of which these are a few. Without an orientation, the joints
    that stay at home are not free.
    """
    held = [not oriented and is_held for is_held in _held(arm)]
    joints = [
        replace(joint, lower=joint.home, upper=joint.home) if is_held else joint
        for joint, is_held in zip(arm.joints, held, strict=True)
    ]
    bound = replace(arm, joints=tuple(joints))
    lower, upper = limits(bound)
    turning = np.array([joint.turning for joint in arm.joints])
    free = np.zeros(len(lower), dtype=bool)
    for q in solutions:
        pose = fk(arm, q)
        target, turn = pose[None, :3, 3], pose[None, :3, :3] if oriented else None
        matrix = jacobian(arm, q)[: 6 if oriented else 3] * ~np.array(held)
        _, values, directions = np.linalg.svd(matrix)
        rank = int(np.sum(values > NEARLY_SINGULAR * values.max()))
        # A singular arm need not be free, as a stretched one is not: so a step is tried.
        for step in FREE * np.vstack([directions[rank:], -directions[rank:]]):
            trial = np.clip(q + step, lower, upper)
            found = numerical.improved(bound, trial[None], target, turn)
            moved = np.where(turning, wrapped(found[0] - q), found[0] - q)
            error = (fk(arm, found[0]) - pose)[:3, 0 if oriented else 3 :]
            if np.abs(error).max() < TOLERANCE and np.abs(moved).max() > FREE / 2:
                free |= np.abs(moved) > FREE / 10
    return tuple(joint.name for joint, is_free in zip(arm.joints, free, strict=True) if is_free)


def why_unreachable(arm: Arm, position: ArrayLike, rotation: ArrayLike | None = None) -> Unreachable:
    """Return the error for one target without a solution: limits, distance or orientation, and the nearest
    point.
    """
    target, turn = _check_target(position, rotation)
    if turn is not None and not is_rotation(turn, RIGHT_HANDED):
        raise InputError(
            "bad-rotation",
            "the orientation of the target is not a rotation: its columns are not right-handed axes",
        )
    if has_closed_form(arm, turn is not None):
        free = closed_solutions(
            arm, target[None], None if turn is None else turn[None], TOLERANCE, hard=False
        )[0]
        free = free[~np.isnan(free[:, 0])]
        if len(free):
            return _unreachable(arm, target, turn, _limit_reason(arm, free), nearest_point(arm, target))
    point = nearest_point(arm, target)
    missed = float(np.linalg.norm(np.asarray(point) - target))
    if missed > NUMERICAL_TOLERANCE:
        reason = (
            f"it is {1000 * missed:z.3f} mm from what the {len(arm.joints)} joints reach within their limits"
        )
    elif turn is not None:
        reason = (
            f"the {len(arm.joints)} joints reach the point, but not in this orientation within their limits"
        )
    else:
        held = [joint.name for joint, is_held in zip(arm.joints, _held(arm), strict=True) if is_held]
        reason = f"not with {', '.join(held) or 'these joints'} at home: give an orientation"
    return _unreachable(arm, target, turn, reason, point)


def _unreachable(
    arm: Arm, target: Floats, turn: Floats | None, reason: str, point: tuple[float, ...]
) -> Unreachable:
    """Return the error, which says whether the nearest point is reached in the requested orientation."""
    as_asked = bool(solve(arm, point, turn, NUMERICAL_TOLERANCE).valid.any())
    return Unreachable(target.tolist(), reason, point, as_asked=as_asked)


def nearest_point(arm: Arm, position: ArrayLike) -> tuple[float, ...]:
    """Return the reachable point (metres) nearest to `position`, in any orientation, within the limits."""
    target = np.asarray(position, float)
    # A descent can end at a local minimum, so the best of many starts is taken.
    starts = np.vstack([arm.home, _spread(arm, 47)])
    approached = numerical.improved(arm, starts, np.broadcast_to(target, (len(starts), 3)), None)
    points = fk_position(arm, numerical.nearest(arm, approached, target))
    best = points[int(np.argmin(np.linalg.norm(points - target, axis=1)))]
    return tuple(float(value) for value in best)


def _check_target(position: ArrayLike, rotation: ArrayLike | None) -> tuple[Floats, Floats | None]:
    target = np.asarray(position, float)
    turn = None if rotation is None else np.asarray(rotation, float)
    if target.shape[-1:] != (3,) or not np.isfinite(target).all():
        raise InputError("not-a-number", "a target needs three finite coordinates x, y, z")
    if turn is not None and (turn.shape[-2:] != (3, 3) or not np.isfinite(turn).all()):
        raise InputError("bad-rotation", "an orientation is a rotation matrix of three rows and columns")
    return target, turn


def _spread(arm: Arm, count: int) -> Floats:
    lower, upper = limits(arm)
    return np.asarray(np.random.default_rng(numerical.SEED).uniform(lower, upper, (count, len(lower))))


def _held(arm: Arm) -> list[bool]:
    """Return which joints stay at home if no orientation is given."""
    free = len(arm.joints) - wrist_joints(arm)
    return [index >= free for index in range(len(arm.joints))]


def _limit_reason(arm: Arm, free: Floats) -> str:
    """Return as text which joints of the solution that exceeds the limits least exceed them, and
    by how much.
    """
    lower, upper = limits(arm)
    beyond = np.maximum(np.maximum(lower - free, free - upper), 0.0)
    best = int(np.argmin((beyond / (upper - lower)).max(axis=1)))
    parts = []
    for joint, value, over in zip(arm.joints, free[best], beyond[best], strict=True):
        if over > TOLERANCE:
            factor, unit = (180 / np.pi, "°") if joint.turning else (1000.0, " mm")
            parts.append(
                f"{joint.name} would have to be at {value * factor:z.3f}{unit},"
                f" its limits are {joint.lower * factor:zg}{unit} to {joint.upper * factor:zg}{unit}"
            )
    return "; ".join(parts)


def sorted_without_doubles(arm: Arm, q: Floats, near: ArrayLike | None) -> Floats:
    """Return the different rows of `q` (k, n), sorted by their distance from `near`, or else from home."""
    reference = np.asarray(arm.home if near is None else near, float)
    lower, upper = limits(arm)
    away = np.round((((q - reference) / (upper - lower)) ** 2).sum(axis=1), 12)
    kept = np.empty_like(q)
    count = 0
    for row in q[np.argsort(away, kind="stable")]:
        if (np.abs(kept[:count] - row).max(axis=1) > SAME).all():
            kept[count] = row
            count += 1
    return kept[:count]
