"""The branches of a closed form, turned into the limits and checked by forward kinematics.

In: an `Arm` with a closed form, targets (m, 3) with or without rotations (m, 3, 3). Out: joint positions
(m, branches, n), NaN in every joint of a branch that is not a solution.

A stretched elbow costs a closed form half of its digits (an arccosine near 1), and on the axis of the first
joint the position does not determine that joint. The other joints of an arm with fewer than six cannot
compensate for the error if an orientation is given, so nearly correct candidates are improved before the
check.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from servogen.errors import InputError, check_known
from servogen.kinematics import catalogue
from servogen.kinematics.forward import BLOCK, fk, whole_chain
from servogen.kinematics.inverse import numerical
from servogen.kinematics.inverse.closed_forms import CLOSED_FORMS, Branch, Solver, TargetComponents
from servogen.kinematics.inverse.meeting_axes import meeting_axes, meeting_axes_branches
from servogen.kinematics.transforms import Floats, frame_matrix, inverse
from servogen.robot.model import Arm, FixedFrame

TOLERANCE = 1e-9
"""The distance (metres, and parts of a unit vector) allowed between forward kinematics and the target."""

RIGHT_HANDED = 1e-6
"""How far o may be from a × n in a target whose orientation is a rotation."""

NEARLY = 1e-3
"""Candidates that miss the target by less than this (metres, parts of a unit vector) are improved."""

SLACK = 1e-4
"""Candidates beyond a limit by less than this (radians, metres) are tried at the limit."""

BESIDE_AXIS_M = 1e-6
"""Targets nearer to the axis of the first joint than this take its angle from the orientation."""


def has_closed_form(arm: Arm, oriented: bool) -> bool:
    """Return whether `arm` is solved in closed form: by the one that it names, or because its axes meet.

    Raises InputError for an arm with an unknown form, or with the form of other rows than it has.
    """
    return _closed_form(arm, oriented) is not None


def _closed_form(arm: Arm, oriented: bool) -> Solver | None:
    """Return the form that solves `arm`; a tool that moves the tip needs an orientation for it."""
    form = arm.closed_form
    if form is None:
        return meeting_axes_branches if oriented and meeting_axes(arm) else None
    check_known("unknown-name", form, CLOSED_FORMS, f"no closed form '{form}'")
    owner = catalogue.arm(form)
    if (arm.rows, arm.convention) != (owner.rows, owner.convention):
        raise InputError(
            "unknown-name",
            f"the rows of '{arm.name}' are not those that the closed form '{form}' solves",
            hint=f'write like = "{form}", or leave closed_form out: the numerical method takes any rows',
        )
    if any(arm.length[name] == 0.0 for name in CLOSED_FORMS[form].divisors):
        return None
    tool = arm.tool
    return CLOSED_FORMS[form].branches if oriented or (tool.x == tool.y == tool.z == 0.0) else None


def closed_solutions(
    arm: Arm, position: Floats, rotation: Floats | None, tolerance: float, hard: bool
) -> Floats:
    """Return the solutions (m, branches, n) of targets (m, 3), NaN for none; `hard` enforces the limits."""
    position, rotation = _without_base_and_tool(arm, position, rotation)
    bare = replace(arm, base=FixedFrame(), tool=FixedFrame())
    blocks = []
    for start in range(0, max(len(position), 1), BLOCK):
        part = slice(start, start + BLOCK)
        components = position[part].T.copy()
        p = (components[0], components[1], components[2])
        if rotation is None:
            target = TargetComponents(p)
        else:
            turn = np.moveaxis(rotation[part], 0, -1).copy()
            n, o, a = ((turn[0, axis], turn[1, axis], turn[2, axis]) for axis in range(3))
            target = TargetComponents(p, n, o, a)
        blocks.append(_branches(bare, target, tolerance, hard))
    return np.moveaxis(np.concatenate(blocks, axis=-1) if len(blocks) > 1 else blocks[0], -1, 0)


def _branches(arm: Arm, target: TargetComponents, tolerance: float, hard: bool) -> Floats:
    """Return the solutions of one block, components last: (branches, n, m)."""
    form = _closed_form(arm, target.n is not None)
    candidates: list[Branch] = form(arm, target) if form else []
    q = np.empty((len(candidates), len(arm.joints), target.p[0].size))
    for branch, values in enumerate(candidates):
        for column, value in enumerate(values):
            q[branch, column] = value
    _turn_on_axis(arm, q, target)
    wrong = np.zeros((len(candidates), q.shape[2]), dtype=bool)
    for column, joint in enumerate(arm.joints):
        angles = q[:, column]
        if joint.turning:
            # into the turn about the middle of the limits; the ends themselves stay where they are
            middle = 0.5 * (joint.lower + joint.upper)
            angles -= (2 * np.pi) * np.rint((angles - middle) * (0.5 / np.pi))
        if hard:
            # A solution at a limit may be beyond it by rounding: it is tried at the limit, and the check
            # decides.
            wrong |= (angles < joint.lower - SLACK) | (angles > joint.upper + SLACK)
            np.clip(angles, joint.lower, joint.upper, out=angles)
    missed = _miss(arm, q, target)
    if target.n is not None and hard:
        _improve(arm, q, target, ~wrong & (missed > tolerance) & (missed < NEARLY), missed)
    wrong |= ~(missed <= tolerance)
    np.copyto(q, np.nan, where=wrong[:, None, :])
    return q


def _miss(arm: Arm, q: Floats, target: TargetComponents) -> Floats:
    """Return the distance (branches, m) of forward kinematics from the target: of its position
    or its axes.
    """
    chain = whole_chain(arm, [q[:, joint] for joint in range(q.shape[1])])
    square = _square_distance(chain.origin, target.p)
    if target.n is not None and target.o is not None and target.a is not None:
        x, _, z = chain.axes()
        square = np.maximum(square, _square_distance(x, target.n) + _square_distance(z, target.a))
        # A left-handed target would pass the check of n and a.
        turned = _square_distance(_cross(target.a, target.n), target.o) <= RIGHT_HANDED**2
        square = np.where(turned, square, np.inf)
    return np.asarray(np.sqrt(np.broadcast_to(square, (q.shape[0], q.shape[2]))))


def _turn_on_axis(arm: Arm, q: Floats, target: TargetComponents) -> None:
    """Turn the first joint of `q` (branches, n, m) by the orientation where the position does not determine
    it.

    With fewer than six joints the other joints follow from the position. The rotation that remains between
    their orientation and the target is about the axis of the first joint.
    """
    if target.n is None or len(arm.joints) >= 6 or not arm.joints[0].turning:
        return
    (on_axis,) = np.nonzero(np.hypot(target.p[0], target.p[1]) < BESIDE_AXIS_M)
    if not len(on_axis):
        return
    near = q[:, :, on_axis]
    rotation = fk(arm, np.moveaxis(near, 1, -1))[..., :3, :3]
    rest = _rotations(target, on_axis) @ np.swapaxes(rotation, -1, -2)
    missed = _miss(arm, near, _part(target, on_axis))
    # The angle of the rotation about z that is nearest to `rest`.
    turn = np.arctan2(rest[..., 1, 0] - rest[..., 0, 1], rest[..., 0, 0] + rest[..., 1, 1])
    q[:, 0, on_axis] += np.where(missed > TOLERANCE, turn, 0.0)


def _improve(arm: Arm, q: Floats, target: TargetComponents, which: NDArray[np.bool_], missed: Floats) -> None:
    """Improve the candidates `which` (branches, m) of `q` and their `missed` numerically, in place."""
    branch, column = np.nonzero(which)
    if not len(branch):
        return
    position = np.stack([component[column] for component in target.p], axis=-1)
    better = numerical.improved(arm, q[branch, :, column], position, _rotations(target, column))
    q[branch, :, column] = better
    missed[branch, column] = _miss(arm, better.T[None], _part(target, column))[0]


def _part(target: TargetComponents, which: NDArray[np.intp]) -> TargetComponents:
    """Return the target at some of its indices."""
    parts = (
        None if vector is None else (vector[0][which], vector[1][which], vector[2][which])
        for vector in (target.n, target.o, target.a)
    )
    x, y, z = target.p
    return TargetComponents((x[which], y[which], z[which]), *parts)


def _rotations(target: TargetComponents, which: NDArray[np.intp]) -> Floats:
    """Return the rotations (k, 3, 3) of a target with an orientation at some of its indices."""
    axes = [vector for vector in (target.n, target.o, target.a) if vector is not None]
    return np.stack([np.stack([point[which] for point in axis], axis=-1) for axis in axes], axis=-1)


def _cross(one: tuple[Floats, ...], two: tuple[Floats, ...]) -> tuple[Floats, Floats, Floats]:
    (a, b, c), (x, y, z) = one, two
    return b * z - c * y, c * x - a * z, a * y - b * x


def _square_distance(one: tuple[Floats | float, ...], two: tuple[Floats, ...]) -> Floats:
    x, y, z = (np.subtract(a, b) for a, b in zip(one, two, strict=True))
    return np.asarray(x * x + y * y + z * z)


def _without_base_and_tool(
    arm: Arm, position: Floats, rotation: Floats | None
) -> tuple[Floats, Floats | None]:
    """Return the target of the last row in the frame before the first: base⁻¹ T tool⁻¹."""
    if not arm.base.identity:
        back = inverse(frame_matrix(arm.base))
        position = position @ back[:3, :3].T + back[:3, 3]
        rotation = None if rotation is None else back[:3, :3] @ rotation
    if not arm.tool.identity and rotation is not None:
        back = inverse(frame_matrix(arm.tool))
        rotation, position = rotation @ back[:3, :3], position + rotation @ back[:3, 3]
    return position, rotation
