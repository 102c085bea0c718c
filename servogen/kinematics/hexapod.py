"""The six-legged robot: its feet in the body frame, and points of the body frame as its legs see them.

In: a `Hexapod`, angles (..., legs, 2) as (α, β). Out: feet (..., legs, 3) in metres, in the mounts' order.

         x forward               left legs: the leg's frame is the body's, turned by the mount's heading
    L1 ──┼── R1                  right legs: its mirror image in the plane y = 0, so that equal angles
    L2 ──┼── R2   y to the left  move both feet alike, forward and backward
    L3 ──┴── R3
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from servogen.kinematics.leg import Leg
from servogen.kinematics.transforms import Floats, rot, transform
from servogen.robot.model import Hexapod, Mount


def mount_matrix(mount: Mount) -> Floats:
    """Body point = matrix · leg point, (4, 4); a mirrored leg's matrix has the determinant -1."""
    mirror = np.diag([1.0, -1.0 if mount.mirrored else 1.0, 1.0])
    return transform(rot("z", mount.heading) @ mirror, (mount.x, mount.y, mount.z))


def to_body(mount: Mount, points: ArrayLike) -> Floats:
    """Points (..., 3) of a leg's frame in the body frame."""
    matrix = mount_matrix(mount)
    return np.asarray(np.asarray(points, float) @ matrix[:3, :3].T + matrix[:3, 3])


def to_leg(mount: Mount, points: ArrayLike) -> Floats:
    """Points (..., 3) of the body frame in a leg's frame."""
    matrix = mount_matrix(mount)
    return np.asarray((np.asarray(points, float) - matrix[:3, 3]) @ matrix[:3, :3])


def feet(robot: Hexapod, angles: ArrayLike) -> Floats:
    """The feet (..., legs, 3) in the body frame for angles (..., legs, 2)."""
    angles = np.asarray(angles, float)
    leg = Leg.of(robot.leg.length)
    points = leg.fk(angles[..., 0], angles[..., 1])
    placed = [to_body(mount, points[..., index, :]) for index, mount in enumerate(robot.mounts)]
    return np.stack(placed, axis=-2)


def angles_of(robot: Hexapod, points: ArrayLike) -> Floats:
    """All angles (..., legs, 2, 2) for feet (..., legs, 3) in the body frame. Raises `Unreachable`."""
    points = np.asarray(points, float)
    leg = Leg.of(robot.leg.length)
    found = [leg.ik(to_leg(mount, points[..., index, :])) for index, mount in enumerate(robot.mounts)]
    return np.stack(found, axis=-3)
