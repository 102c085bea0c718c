"""Static stability: how far the centre of mass is inside the polygon of the feet on the ground.

In: points of the ground plane. Out: the margin in metres, below 0 outside the polygon.
"""

from __future__ import annotations

import math

import numpy as np

from servogen.motion.trajectory import Floats


def support_polygon(feet: Floats) -> Floats:
    """Return the corners (k, 2) of the convex hull of `feet` (n, 2), counter-clockwise (Andrew's monotone
    chain).
    """
    points = sorted(set(map(tuple, feet.tolist())))
    if len(points) < 3:
        return np.array(points).reshape(len(points), 2)
    halves = []
    for order in (points, points[::-1]):
        chain: list[tuple[float, ...]] = []
        for point in order:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        # The last point of each half is the first of the other.
        halves.append(chain[:-1])
    return np.array(halves[0] + halves[1])


def margin(feet: Floats, centre: Floats) -> float:
    """Return the distance of `centre` from the nearest edge of the support polygon of `feet` (n, 2).

    Outside the polygon it is negative, the distance to it; with no foot on the ground it is -inf.
    """
    corners = support_polygon(feet)
    if not len(corners):
        return -math.inf
    # A point or a line segment has no inside.
    if len(corners) < 3:
        return -_to_segment(corners[0], corners[-1], centre)
    after = np.roll(corners, -1, axis=0)
    edges = after - corners
    inward = np.stack([-edges[:, 1], edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1)[:, None]
    inside = np.einsum("ij,ij->i", centre - corners, inward)
    if (inside >= 0).all():
        return float(inside.min())
    return -min(_to_segment(a, b, centre) for a, b in zip(corners, after, strict=True))


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _to_segment(a: Floats, b: Floats, point: Floats) -> float:
    """Return the distance of a point from a line segment."""
    edge = b - a
    square = float(edge @ edge)
    share = min(1.0, max(0.0, float((point - a) @ edge) / square)) if square else 0.0
    return float(np.linalg.norm(point - a - share * edge))
