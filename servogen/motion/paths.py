"""Paths of a point in space: the straight line and the arc.

In: points in metres. Out: a path: `point` returns the point at a share from 0 to 1, `distance` how far other
points are from the path.

                                   through
    start ●───────────● end      ╭────●────╮        the arc goes from start through the second
                           start ●    c    ● end    point to end, about c
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from servogen.errors import InputError, Location
from servogen.motion.trajectory import Floats

STRAIGHT_M = 1e-9
"""Three points within this distance of a line (metres) do not define a circle."""


SAME_POINT_M = 1e-5
"""An arc whose ends are this near is a whole circle: the digits of typed points that are left out."""


class SpatialPath(Protocol):
    """A path through space."""

    @property
    def length(self) -> float:
        """Return the length in metres."""

    def point(self, share: ArrayLike) -> Floats:
        """Return the points (n, 3) at shares of the path."""

    def distance(self, points: Floats) -> Floats:
        """Return the distance in metres of each of the points (n, 3) from the path."""


@dataclass(frozen=True, slots=True)
class StraightLine:
    """A straight line from `start` to `end`."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]

    @property
    def length(self) -> float:
        """Return the length in metres."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    def point(self, share: ArrayLike) -> Floats:
        """Return the points (n, 3) at shares of the line."""
        start, end = np.array(self.start), np.array(self.end)
        return np.asarray(start + np.asarray(share, float)[..., None] * (end - start))

    def distance(self, points: Floats) -> Floats:
        """Return the distance in metres of each of the points (n, 3) from the line."""
        start, displacement = np.array(self.start), np.subtract(self.end, self.start)
        square = float(displacement @ displacement)
        share = (
            np.clip((points - start) @ displacement / square, 0.0, 1.0) if square else np.zeros(len(points))
        )
        return np.asarray(np.linalg.norm(points - start - share[..., None] * displacement, axis=-1))


@dataclass(frozen=True, slots=True)
class Arc:
    """About `centre`: the point at share t is centre + radius (cos(t angle) first + sin(t angle) second).

    `first` points to the start; `second` is normal to it in the plane of the arc; both are unit vectors.
    """

    centre: tuple[float, float, float]
    first: tuple[float, float, float]
    second: tuple[float, float, float]
    radius: float
    angle: float

    @property
    def length(self) -> float:
        """Return the length in metres."""
        return self.radius * self.angle

    def point(self, share: ArrayLike) -> Floats:
        """Return the points (n, 3) at shares of the arc."""
        turn = np.asarray(share, float)[..., None] * self.angle
        spoke = np.cos(turn) * np.array(self.first) + np.sin(turn) * np.array(self.second)
        return np.asarray(np.array(self.centre) + self.radius * spoke)

    def distance(self, points: Floats) -> Floats:
        """Return the distance in metres of each of the points (n, 3) from the arc."""
        away = points - np.array(self.centre)
        x, y = away @ np.array(self.first), away @ np.array(self.second)
        turn = np.mod(np.arctan2(y, x), 2 * np.pi)
        # Outside the arc the nearer end is nearest; the middle of the gap separates the two cases.
        beyond = turn > (self.angle + 2 * np.pi) / 2
        share = np.where(beyond, 0.0, np.minimum(turn / self.angle, 1.0))
        return np.asarray(np.linalg.norm(points - self.point(share), axis=-1))


def arc(start: ArrayLike, through: ArrayLike, end: ArrayLike, place: Location | None = None) -> Arc:
    """Return the arc from `start` through `through` to `end`, a whole circle if it ends where it starts.

    Raises InputError for collinear points.
    """
    a, b, c = (np.asarray(point, float) for point in (start, through, end))
    if np.linalg.norm(c - a) <= SAME_POINT_M < np.linalg.norm(b - a):
        return _circle(a, b, place)
    u, v = b - a, c - a
    normal = np.cross(u, v)
    area2 = float(normal @ normal)
    longest = max(float(np.linalg.norm(side)) for side in (u, v, c - b))
    if np.sqrt(area2) <= STRAIGHT_M * longest or longest <= STRAIGHT_M:
        raise InputError(
            "pose-keys",
            "the three points of the arc are on one line",
            place,
            "use a line, without a point to go through",
        )
    # The circumcentre lies in the plane, equally far from a, b and c.
    centre = a + (float(v @ v) * np.cross(normal, u) + float(u @ u) * np.cross(v, normal)) / (2 * area2)
    radius = float(np.linalg.norm(a - centre))
    first = (a - centre) / radius
    second = np.cross(normal / np.sqrt(area2), first)
    angle = float(np.mod(np.arctan2((c - centre) @ second, (c - centre) @ first), 2 * np.pi))
    return Arc(
        centre=_triple(centre), first=_triple(first), second=_triple(second), radius=radius, angle=angle
    )


def _circle(start: Floats, opposite: Floats, place: Location | None) -> Arc:
    """Return the circle with this diameter, as level as the diameter allows, counter-clockwise from above.

    Raises InputError for a vertical diameter, which leaves its plane open.
    """
    radius = float(np.linalg.norm(opposite - start)) / 2
    level = np.cross((0.0, 0.0, 1.0), start - opposite)
    across = float(np.linalg.norm(level))
    if across <= STRAIGHT_M:
        raise InputError(
            "pose-keys",
            "an arc back to its start goes through the opposite point, which must lie beside the start",
            place,
            "make the circle of two arcs, each with a point of its own to go through",
        )
    return Arc(
        centre=_triple((start + opposite) / 2),
        first=_triple((start - opposite) / (2 * radius)),
        second=_triple(level / across),
        radius=radius,
        angle=2 * np.pi,
    )


def _triple(vector: Floats) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
