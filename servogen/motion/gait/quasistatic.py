"""A check of the physics by other equations: the path of a walking robot with rigid legs and without inertia.

In: the feet in the body's frame, frame by frame, which of them are down, the centre of mass. Out: the body's
pose after each frame. The method shares no equation with the physics.

From frame to frame the joints move foot i in the body's frame by s_i. The body responds with the twist
(dx, dy, dθ) that minimises the work of friction, the sum over the feet on the ground of

    normal force N_i  ·  | s_i + (dx, dy) + dθ (-y_i, x_i) |            the foot's slip over the ground

found by iteratively reweighted least squares. The coefficient of friction cancels out. The normal forces are
those of equally stiff legs in balance (`kinematics.statics.foot_forces`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.kinematics.statics import foot_forces

Floats = npt.NDArray[np.float64]

CONTACT_M = 0.001
"""Feet within this distance of the lowest one are on the ground, because legs yield by this much."""

ROUNDS = 60
"""The number of iterations of the weights."""

REGULAR, TINY = 1e-12, 1e-9
"""Keeps the equations solvable if at most one foot is down: the body then does not move by itself."""

SMALL_M = 1e-9
"""The minimum slip in weights: a foot that does not slip would have an infinite weight."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyPath:
    """`pose` (frames, 3): x, y, yaw of the body, from (0, 0, 0); `slip` (frames, legs): metres per frame."""

    pose: Floats
    slip: Floats


def rigid_body_path(
    feet: Floats, centre: tuple[float, float], ground: npt.NDArray[np.bool_] | None = None
) -> BodyPath:
    """Return the path of a body whose feet are at `feet` (frames, legs, 3) in its frame.

    `ground` (frames, legs) states which feet are down; None: those within `CONTACT_M` of the lowest.
    """
    if ground is None:
        ground = feet[..., 2] <= feet[..., 2].min(axis=1, keepdims=True) + CONTACT_M
    down = ground[1:] & ground[:-1]
    middle = (feet[1:] + feet[:-1])[..., :2] / 2
    moved = np.diff(feet[..., :2], axis=0)
    forces = foot_forces(middle, down, np.asarray(centre, float), 1.0)
    weights = np.where(np.isnan(forces), down / np.maximum(down.sum(axis=1, keepdims=True), 1), forces)
    twist = _minimum_slip(middle, moved, weights)
    slip = np.where(weights > 0, np.linalg.norm(_slips(twist, middle, moved), axis=-1), 0.0)
    return BodyPath(_integrate(twist), np.vstack([np.zeros((1, feet.shape[1])), slip]))


def _slips(twist: Floats, feet: Floats, moved: Floats) -> Floats:
    """Return the slips (n, legs, 2) of feet over the ground."""
    across = np.stack([-feet[..., 1], feet[..., 0]], axis=-1)
    return np.asarray(moved + twist[:, None, :2] + twist[:, None, 2:] * across)


def _minimum_slip(feet: Floats, moved: Floats, weights: Floats) -> Floats:
    """Return the twists (n, 3) with the minimum weighted slip."""
    ones, zeros = np.ones(feet.shape[:2]), np.zeros(feet.shape[:2])
    rows = np.stack(
        [np.stack([ones, zeros, -feet[..., 1]], -1), np.stack([zeros, ones, feet[..., 0]], -1)], axis=2
    )
    twist = np.zeros((len(feet), 3))
    share = weights.copy()
    for _ in range(ROUNDS):
        normal = np.einsum("nl,nlri,nlrj->nij", share, rows, rows)
        # The regularisation is relative to the equations' size, so it does not depend on units or weights.
        scale = np.maximum(np.trace(normal, axis1=1, axis2=2), TINY)
        normal += REGULAR * scale[:, None, None] * np.eye(3)
        right = -np.einsum("nl,nlri,nlr->ni", share, rows, moved)
        twist = np.linalg.solve(normal, right[..., None])[..., 0]
        length = np.linalg.norm(_slips(twist, feet, moved), axis=-1)
        # A square weighted by 1 / length is a length: the fixed point minimises the sum of lengths.
        share = weights / np.maximum(length, SMALL_M)
    return twist


def _integrate(twist: Floats) -> Floats:
    """Return the poses (n + 1, 3) after twists in the body's frame, each along its arc."""
    yaw = np.concatenate([[0.0], np.cumsum(twist[:, 2])])
    # The chord of an arc of angle t is sin(t/2) / (t/2) of its length; numpy's sinc(x) is sin(πx) / πx.
    step = (twist[:, 0] + 1j * twist[:, 1]) * np.sinc(twist[:, 2] / (2 * np.pi))
    positions = np.concatenate([[0j], np.cumsum(step * np.exp(1j * (yaw[:-1] + twist[:, 2] / 2)))])
    return np.column_stack([positions.real, positions.imag, yaw])
