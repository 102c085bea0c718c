"""The static loads of gravity on the joints of an arm and on the feet under a body.

In: an `Arm` with masses and its joint positions; or feet on the ground and a centre of mass. Out: torques in
N·m (forces in N of sliding joints), and the vertical force at each foot.

    arm     V = Σ m g z,  τ = ∂V/∂q: the z row of the Jacobian of each link's centre of mass, times m g
    feet    Σ F = W,  Σ F x = W x_c,  Σ F y = W y_c,  F ≥ 0

The forces at three feet follow from these equations. More feet are assumed to be equally stiff legs under a
rigid body: their forces are the shortest vector that keeps the balance, and a foot that would pull carries
none.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from servogen.kinematics.forward import joint_array
from servogen.kinematics.jacobian import with_pose
from servogen.kinematics.transforms import Floats
from servogen.robot.model import Arm, FixedFrame

GRAVITY = 9.80665
"""Standard gravity, m/s² (3rd CGPM, 1901)."""

BALANCED = 1e-6
"""The share of the weight by which forces and moments in balance may differ from it."""

BLOCK = 16_384
"""The number of frames computed at a time."""


def has_masses(arm: Arm) -> bool:
    """Return whether the arm's file states any mass."""
    return arm.payload > 0 or any(joint.mass > 0 for joint in arm.joints)


def gravity_torques(arm: Arm, q: ArrayLike) -> Floats:
    """Return the torques (..., n) with which the joints hold the links and the payload at positions (..., n).

    Units are N·m, or N for sliding joints. The base's frame has its z upwards.
    """
    masses, _, slopes = moving_masses(arm, q)
    return np.asarray(GRAVITY * np.einsum("k,...kn->...n", masses, slopes[..., 2, :]))


def moving_masses(arm: Arm, q: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return the masses (k,) of the links and the payload, their places (..., k, 3), and the derivatives of
    these by the joints (..., k, 3, n).
    """
    q = joint_array(arm, q)
    parts: list[tuple[float, Arm]] = [(arm.payload, arm)] if arm.payload > 0 else []
    for index, joint in enumerate(arm.joints):
        if joint.mass > 0:
            last = next(number for number, row in enumerate(arm.rows) if row.joint == index)
            # The arm cut off after this joint, with the link's centre of mass as its tool: its Jacobian has
            # the rest.
            link = replace(arm, rows=arm.rows[: last + 1], tool=FixedFrame(*joint.centre))
            parts.append((joint.mass, link))
    places = np.zeros((*q.shape[:-1], len(parts), 3))
    slopes = np.zeros((*places.shape, q.shape[-1]))
    for index, (_, part) in enumerate(parts):
        matrix, pose = with_pose(part, q)
        places[..., index, :], slopes[..., index, :, :] = pose[..., :3, 3], matrix[..., :3, :]
    return np.array([mass for mass, _ in parts]), places, slopes


def foot_forces(feet: Floats, ground: npt.NDArray[np.bool_], centre: Floats, weight_n: float) -> Floats:
    """Return the vertical forces (frames, legs), N, at feet (frames, legs, 2) of which `ground` stand.

    NaN in a frame in which the standing feet cannot carry the centre of mass (2,).
    """
    forces = np.empty(ground.shape)
    for start in range(0, len(ground), BLOCK):
        part = slice(start, start + BLOCK)
        forces[part] = _forces(feet[part], ground[part], centre, weight_n)
    return forces


def _forces(feet: Floats, ground: npt.NDArray[np.bool_], centre: Floats, weight_n: float) -> Floats:
    # About the centre of mass: then the moments on the right are 0.
    """Return the forces of `foot_forces` for one block of frames."""
    balance = np.stack([np.ones(ground.shape), *np.moveaxis(feet - centre, -1, 0)], axis=1)
    load = np.array([weight_n, 0.0, 0.0])
    carrying = ground.copy()
    while True:
        # The pseudo-inverse gives the shortest vector, which is that of equally stiff legs.
        forces: Floats = np.linalg.pinv(balance * carrying[:, None, :]) @ load
        pulling = forces.min(axis=1) < -BALANCED * weight_n
        if not pulling.any():
            break
        # One foot at a time: without it others may no longer pull.
        carrying[np.flatnonzero(pulling), forces[pulling].argmin(axis=1)] = False
    left = np.abs(np.einsum("nij,nj->ni", balance, forces) - load).max(axis=1)
    forces[left > BALANCED * weight_n] = np.nan
    return np.maximum(forces, 0.0)
