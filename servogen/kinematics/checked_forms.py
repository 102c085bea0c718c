"""The branches of a closed form, turned into the limits and checked by forward kinematics.

In: an `Arm` with a closed form, targets (m, 3) with or without rotations (m, 3, 3). Out: joint positions
(m, branches, n), NaN in every joint of a branch that is no solution.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from servogen.errors import InputError, nearest
from servogen.kinematics.chain import BLOCK, whole_chain
from servogen.kinematics.closed_forms import CLOSED_FORMS, DIVISORS
from servogen.kinematics.target import Branch, Target
from servogen.kinematics.transforms import Floats, frame_matrix, inverse
from servogen.robot import robots
from servogen.robot.model import Arm, Frame

TOLERANCE = 1e-9
"""How far (metres, and parts of a unit vector) forward kinematics may be from the target."""

RIGHT_HANDED = 1e-6
"""How far o may be from a × n: a matrix that is no rotation is no orientation."""


def has_closed_form(arm: Arm, oriented: bool) -> bool:
    """Whether `arm` is solved in closed form: a tool that moves the tip needs an orientation for it.

    Raises InputError when `arm` claims a form that is none, or that belongs to other rows than it has.
    """
    form = arm.closed_form
    if form is None:
        return False
    if form not in CLOSED_FORMS:
        raise InputError(f"no closed form '{form}'", hint=nearest(form, CLOSED_FORMS))
    owner = robots.arm(form)
    if (arm.rows, arm.convention) != (owner.rows, owner.convention):
        raise InputError(
            f"the rows of '{arm.name}' are not those that the closed form '{form}' solves",
            hint=f'write like = "{form}", or leave closed_form out: the numerical method takes any rows',
        )
    if any(arm.length[name] == 0.0 for name in DIVISORS.get(form, ())):
        return False
    tool = arm.tool
    return oriented or (tool.x == tool.y == tool.z == 0.0)


def closed_solutions(
    arm: Arm, position: Floats, rotation: Floats | None, tolerance: float, hard: bool
) -> Floats:
    """The solutions (m, branches, n) of targets (m, 3), NaN where none; `hard` keeps the limits."""
    position, rotation = _without_base_and_tool(arm, position, rotation)
    bare = replace(arm, base=Frame(), tool=Frame())
    blocks = []
    for start in range(0, max(len(position), 1), BLOCK):
        part = slice(start, start + BLOCK)
        components = position[part].T.copy()
        p = (components[0], components[1], components[2])
        if rotation is None:
            target = Target(p)
        else:
            turn = np.moveaxis(rotation[part], 0, -1).copy()
            n, o, a = ((turn[0, axis], turn[1, axis], turn[2, axis]) for axis in range(3))
            target = Target(p, n, o, a)
        blocks.append(_branches(bare, target, tolerance, hard))
    return np.moveaxis(np.concatenate(blocks, axis=-1) if len(blocks) > 1 else blocks[0], -1, 0)


def _branches(arm: Arm, target: Target, tolerance: float, hard: bool) -> Floats:
    """The solutions of one block, components last: (branches, n, m)."""
    candidates: list[Branch] = CLOSED_FORMS[arm.closed_form or ""](arm, target)
    q = np.empty((len(candidates), len(arm.joints), target.p[0].size))
    for branch, values in enumerate(candidates):
        for column, value in enumerate(values):
            q[branch, column] = value
    wrong = np.zeros((len(candidates), q.shape[2]), dtype=bool)
    for column, joint in enumerate(arm.joints):
        angles = q[:, column]
        if joint.turning:
            # into the turn about the middle of the limits; the ends themselves stay where they are
            middle = 0.5 * (joint.lower + joint.upper)
            angles -= (2 * np.pi) * np.rint((angles - middle) * (0.5 / np.pi))
        if hard:
            wrong |= (angles < joint.lower - TOLERANCE) | (angles > joint.upper + TOLERANCE)
            np.clip(angles, joint.lower, joint.upper, out=angles)
    wrong |= ~_gives_back(arm, q, target, tolerance)
    np.copyto(q, np.nan, where=wrong[:, None, :])
    return q


def _gives_back(arm: Arm, q: Floats, target: Target, tolerance: float) -> NDArray[np.bool_]:
    """Whether forward kinematics gives the target: position, and two axes of the orientation."""
    chain = whole_chain(arm, [q[:, joint] for joint in range(q.shape[1])])
    right = _square_distance(chain.origin, target.p) <= tolerance**2
    if target.n is not None and target.o is not None and target.a is not None:
        x, _, z = chain.axes()
        right &= _square_distance(x, target.n) + _square_distance(z, target.a) <= tolerance**2
        right &= _square_distance(_cross(target.a, target.n), target.o) <= RIGHT_HANDED**2
    return np.asarray(np.broadcast_to(right, (q.shape[0], q.shape[2])))


def _cross(one: tuple[Floats, ...], two: tuple[Floats, ...]) -> tuple[Floats, Floats, Floats]:
    (a, b, c), (x, y, z) = one, two
    return b * z - c * y, c * x - a * z, a * y - b * x


def _square_distance(one: tuple[Floats | float, ...], two: tuple[Floats, ...]) -> Floats:
    x, y, z = (np.subtract(a, b) for a, b in zip(one, two, strict=True))
    return np.asarray(x * x + y * y + z * z)


def _without_base_and_tool(
    arm: Arm, position: Floats, rotation: Floats | None
) -> tuple[Floats, Floats | None]:
    """The target of the last row in the frame before the first: base⁻¹ T tool⁻¹."""
    if not arm.base.identity:
        back = inverse(frame_matrix(arm.base))
        position = position @ back[:3, :3].T + back[:3, 3]
        rotation = None if rotation is None else back[:3, :3] @ rotation
    if not arm.tool.identity and rotation is not None:
        back = inverse(frame_matrix(arm.tool))
        rotation, position = rotation @ back[:3, :3], position + rotation @ back[:3, 3]
    return position, rotation
