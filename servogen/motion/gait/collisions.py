"""Whether the legs of a walk meet each other or the body: distances of their centre lines, in every frame.

In: a `WalkingRobot` and the angles of its legs. Out: the two that come nearest, if that is nearer than a gap.
A leg is the line through its corners, the body the lines between all of its mounts: capsules of one
thickness touch where their lines are as far apart as they are thick. Only the last part of a leg, that with
the foot, is compared with the body: the others begin on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from servogen.kinematics.protocol import WalkingRobot, mounts_of
from servogen.motion.trajectory import Floats

GAP_M = 0.012
"""The gap unless one is stated: legs 12 mm thick, as the twin has them."""


@dataclass(frozen=True, slots=True)
class Collision:
    """What comes too near to what, by how much (metres, between centre lines) and in which frame."""

    one: str
    other: str
    distance: float
    frame: int

    def text(self) -> str:
        """Return the fact in words."""
        return (
            f"{self.one} and {self.other} come within {1000 * self.distance:z.1f} mm of each other in "
            f"frame {self.frame}"
        )


def nearest_collision(robot: WalkingRobot, leg_angles: Floats, gap: float) -> Collision | None:
    """Return the smallest distance below `gap` (metres) between two legs, or a leg and the body; None if
    there is none. `leg_angles` is (frames, legs, k).
    """
    lines = [robot.corners(index, leg_angles[:, index]) for index in range(len(robot.limbs))]
    names = [f"the leg {limb.name}" for limb in robot.limbs]
    mounts = [np.array([mount.x, mount.y, mount.z]) for mount in mounts_of(robot)]
    plate = [np.broadcast_to(np.stack(ends), (len(leg_angles), 2, 3)) for ends in combinations(mounts, 2)]
    pairs = [(names[a], names[b], lines[a], lines[b]) for a, b in combinations(range(len(lines)), 2)]
    pairs += [
        (name, "the body", line[:, -2:], bar)
        for name, line in zip(names, lines, strict=True)
        for bar in plate
    ]
    worst: Collision | None = None
    for one, other, first, second in pairs:
        found = _nearest(first, second, gap if worst is None else worst.distance)
        if found is not None:
            worst = Collision(one, other, *found)
    return worst


def _nearest(first: Floats, second: Floats, below: float) -> tuple[float, int] | None:
    """Return the smallest distance of two lines (n, corners, 3) and its row; None if it is not `below`."""
    # Boxes around the lines: most frames need no more.
    distances = np.maximum(first.min(axis=1) - second.max(axis=1), second.min(axis=1) - first.max(axis=1))
    rows = np.flatnonzero(np.linalg.norm(np.maximum(distances, 0.0), axis=1) < below)
    if not len(rows):
        return None
    a, b = first[rows], second[rows]
    away = segment_distance(a[:, :-1, None], a[:, 1:, None], b[:, None, :-1], b[:, None, 1:]).min(axis=(1, 2))
    row = int(np.argmin(np.round(away, 9)))
    return (float(away[row]), int(rows[row])) if away[row] < below else None


def segment_distance(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Return the distances (...,) between segments from `a` to `b` and from `c` to `d`, each (..., 3).

    The nearest points of two lines, or of a line and an end of the other, cut off at the ends (C. Ericson,
    Real-Time Collision Detection, section 5.1.9).
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    least = 1e-18
    area = uu * vv - uv * uv
    s = np.clip(
        np.where(area > least * uu * vv, (uv * vw - uw * vv) / np.maximum(area, least), 0.0), 0.0, 1.0
    )
    t = np.clip((uv * s + vw) / np.maximum(vv, least), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, least), 0.0, 1.0)
    return np.asarray(np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1))
