"""Differential motion: small displacements from frame to frame, cylindrical and spherical speeds.

In: a small translation d and rotation δ (metres, radians), or speeds. Out: Δ, dT, the same motion seen from
a moved frame. Small rotations commute to first order, so δ is a vector.

        ┌  0   -δz   δy   dx ┐
    Δ = │  δz   0   -δx   dy │      dT = Δ T = T ᵀΔ,   ᵀΔ = T⁻¹ Δ T
        │ -δy   δx   0    dz │
        └  0    0    0    0  ┘
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from servogen.kinematics.transforms import Floats, inverse, skew


def differential(d: ArrayLike, delta: ArrayLike) -> Floats:
    """Δ (..., 4, 4) of a small translation d (..., 3) and rotation δ (..., 3)."""
    d, delta = np.broadcast_arrays(np.asarray(d, float), np.asarray(delta, float))
    matrix = np.zeros((*d.shape[:-1], 4, 4))
    matrix[..., :3, :3] = skew(delta)
    matrix[..., :3, 3] = d
    return matrix


def change(frame: ArrayLike, d: ArrayLike, delta: ArrayLike) -> Floats:
    """dT = Δ T (..., 4, 4): how a frame changes by a motion about the fixed axes."""
    return np.asarray(differential(d, delta) @ np.asarray(frame, float))


def seen_from(frame: ArrayLike, d: ArrayLike, delta: ArrayLike) -> tuple[Floats, Floats]:
    """The same motion in the axes of T: ᵀd = (n, o, a)·(δ × p + d), ᵀδ = (δ·n, δ·o, δ·a), each (..., 3)."""
    frame, d, delta = (np.asarray(value, float) for value in (frame, d, delta))
    back = np.swapaxes(frame[..., :3, :3], -1, -2)
    moved = np.cross(delta, frame[..., :3, 3]) + d
    return np.asarray((back @ moved[..., None])[..., 0]), np.asarray((back @ delta[..., None])[..., 0])


def motion_of(matrix: ArrayLike, frame: ArrayLike) -> tuple[Floats, Floats]:
    """d and δ of a change dT of T: Δ = dT T⁻¹."""
    delta = np.asarray(matrix, float) @ inverse(frame)
    turned = np.stack([delta[..., 2, 1], delta[..., 0, 2], delta[..., 1, 0]], axis=-1)
    return np.asarray(delta[..., :3, 3]), turned


def cylindrical_jacobian(r: ArrayLike, alpha: ArrayLike) -> Floats:
    """(ẋ, ẏ, ż) = J (ṙ, α̇, ċ), shape (..., 3, 3)."""
    r, alpha = np.broadcast_arrays(np.asarray(r, float), np.asarray(alpha, float))
    cosine, sine = np.cos(alpha), np.sin(alpha)
    matrix = np.zeros((*r.shape, 3, 3))
    matrix[..., 0, 0], matrix[..., 0, 1] = cosine, -r * sine
    matrix[..., 1, 0], matrix[..., 1, 1] = sine, r * cosine
    matrix[..., 2, 2] = 1.0
    return matrix


def spherical_jacobian(r: ArrayLike, beta: ArrayLike, gamma: ArrayLike) -> Floats:
    """(ẋ, ẏ, ż) = J (ṙ, β̇, γ̇), shape (..., 3, 3); its last row is (cos β, -r sin β, 0)."""
    r, beta, gamma = np.broadcast_arrays(*(np.asarray(value, float) for value in (r, beta, gamma)))
    (cb, sb), (cg, sg) = (np.cos(beta), np.sin(beta)), (np.cos(gamma), np.sin(gamma))
    rows = [
        [sb * cg, r * cb * cg, -r * sb * sg],
        [sb * sg, r * cb * sg, r * sb * cg],
        [cb, -r * sb, np.zeros_like(r)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
