"""A path in space as joint angles, and how far the joints' straight ways between them stray from it.

In: a path, the robot's inverse (all solutions) and its forward kinematics. Out: `Followed`: joint angles at
chosen shares of the path with a stated chord error: between two of them the joints go straight in joint
space, and the point leaves the path by that much.

         path  ___________        the chord: where the joints are half way between two
              ╱   chord   ╲       samples, seen through the forward kinematics
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError, Place
from servogen.motion.paths import Path
from servogen.motion.trajectory import Floats

Inverse = Callable[[Floats], Floats]
"""Points (n, 3) -> all solutions (n, solutions, joints), NaN where there is none."""

Forward = Callable[[Floats], Floats]
"""Joint angles (n, joints) -> points (n, 3)."""

INSIDE = np.array([0.25, 0.5, 0.75])
"""Where between two samples the chord error is looked at."""

MOST_SAMPLES = 1 << 14


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Joint angles (n, joints) at the `shares` (n,) of the path, and the worst chord error in metres."""

    shares: Floats
    angles: Floats
    chord_error_m: float


def follow(
    path: Path,
    shares: ArrayLike,
    inverse: Inverse,
    forward: Forward,
    start: ArrayLike,
    place: Place | None = None,
) -> Followed:
    """The joint angles at `shares` of the path, on the branch nearest to the joint angles `start`.

    Raises InputError where the path leaves what the robot reaches, or breaks off the branch.
    """
    shares = np.asarray(shares, float)
    points = path.point(shares)
    angles = _connected(points, inverse(points), np.asarray(start, float), place)
    return Followed(shares, angles, float(_chord_errors(path, angles, forward).max(initial=0.0)))


def refine(
    path: Path,
    chord_m: float,
    inverse: Inverse,
    forward: Forward,
    start: ArrayLike,
    place: Place | None = None,
) -> Followed:
    """As `follow`, at as few halvings of the path as keep the chord error within `chord_m`.

    Raises InputError when that takes more than 16384 samples.
    """
    shares = np.linspace(0.0, 1.0, 3)
    while True:
        followed = follow(path, shares, inverse, forward, start, place)
        errors = _chord_errors(path, followed.angles, forward)
        far = errors > chord_m
        if not far.any():
            return followed
        if len(shares) + far.sum() > MOST_SAMPLES:
            raise InputError(
                f"the path cannot be followed within {1000 * chord_m:g} mm",
                place,
                "allow a larger chord error",
            )
        shares = np.sort(np.concatenate((shares, (shares[:-1][far] + shares[1:][far]) / 2)))


def _chord_errors(path: Path, angles: Floats, forward: Forward) -> Floats:
    """The worst distance from the path inside each of the n - 1 intervals."""
    if len(angles) < 2:
        return np.zeros(0)
    between = angles[:-1, None, :] + INSIDE[:, None] * (angles[1:, None, :] - angles[:-1, None, :])
    points = forward(between.reshape(-1, angles.shape[1]))
    return np.asarray(path.distance(points).reshape(-1, len(INSIDE)).max(axis=1))


def _connected(points: Floats, solutions: Floats, start: Floats, place: Place | None) -> Floats:
    """For each point the solution nearest to the one before it, the first nearest to `start`."""
    lost = np.all(np.isnan(solutions).any(axis=2), axis=1)
    if lost.any():
        x, y, z = (1000 * float(value) for value in points[np.argmax(lost)])
        raise InputError(
            f"the path leaves what can be reached at ({x:.3f}, {y:.3f}, {z:.3f}) mm",
            place,
            "move the ends, or go from pose to pose without a path",
        )
    chosen = np.empty((len(points), solutions.shape[2]))
    before = start
    for index, candidates in enumerate(solutions):
        away = np.abs(candidates - before).max(axis=1)
        chosen[index] = before = candidates[np.nanargmin(away)]
    return chosen
