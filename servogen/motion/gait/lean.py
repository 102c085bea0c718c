"""How a body leans before a foot lifts: away from that foot, over those that stay.

In: the gait, where the feet stand. Out: the offset of the body, x + iy in metres, while each foot is in the
air, and at any time between.

    ▁▁▁▁▔▔▔▁▁▁▁▁▁▁▁▁▁▁   LH       while a foot is in the air the body waits where the others carry it
    ▁▁▁▁▁▁▁▁▁▁▁▔▔▔▁▁▁▁   LF
    ────┐   ┌──╲   ╱──   offset   between landing and lifting it goes over, by a law at rest at both ends
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from servogen.motion.gait.phases import Gait
from servogen.motion.gait.stability import support_polygon
from servogen.motion.trajectory import Floats

Complexes = npt.NDArray[np.complex128]

ROUNDS = 100
"""The number of steps towards an offset; each one mends the margin that is worst."""

SAME_M = 1e-9

LEAST_SHARE = 0.1
"""The least share of an edge's direction along the x axis with which a body that leans along it is mended."""


@dataclass(frozen=True, slots=True)
class Lean:
    """`times` (in cycles, ascending) and the `offsets` between which the body goes over; constant outside."""

    times: Floats
    offsets: Complexes

    def at(self, time: Floats) -> Complexes:
        """Return the offsets (n,) at times (n,)."""
        after = np.clip(np.searchsorted(self.times, time, side="right"), 1, len(self.times) - 1)
        first, last = self.times[after - 1], self.times[after]
        share = np.clip((time - first) / np.maximum(last - first, SAME_M), 0.0, 1.0)
        smooth = share**3 * (10 - 15 * share + 6 * share**2)
        before = self.offsets[after - 1]
        return np.asarray(before + (self.offsets[after] - before) * smooth)


STILL = Lean(np.array([0.0, 1.0]), np.zeros(2, complex))
"""A body that does not lean."""


def least_rest(gait: Gait) -> Fraction:
    """Return the least time, in cycles, from a landing to the next lift; below 0 where swings overlap."""
    lifts = sorted(lift for _, lift in gait.lifts)
    following = [*lifts[1:], lifts[0] + 1]
    return min(after - before for before, after in zip(lifts, following, strict=True)) - gait.swing


def one_at_a_time(gait: Gait) -> bool:
    """Return whether a foot lifts only after every other one has landed, and some time later."""
    return least_rest(gait) > 0


def offset_over(polygons: Sequence[Complexes], centre: complex, margin: float, *, along_x: bool) -> complex:
    """Return the least offset, nearly, with which `centre` is `margin` inside each polygon of feet (k,)."""
    offset = 0j
    edges = [edge for feet in polygons for edge in _edges(feet)]
    for _ in range(ROUNDS):
        short, normal = max(
            (
                (margin - ((centre + offset - point) * normal.conjugate()).real, normal)
                for point, normal in edges
            ),
            key=lambda edge: edge[0],
            default=(0.0, 1 + 0j),
        )
        if short <= SAME_M:
            break
        if not along_x:
            offset += short * normal
        elif abs(normal.real) > LEAST_SHARE:
            offset += short / normal.real
        else:
            break
    return offset


def _edges(feet: Complexes) -> list[tuple[complex, complex]]:
    """Return a point and the inward unit normal of each edge of the feet's support polygon."""
    corners = support_polygon(np.stack([feet.real, feet.imag], axis=1))
    if len(corners) < 3:
        return []
    points = [complex(x, y) for x, y in corners.tolist()]
    after = [*points[1:], points[0]]
    return [(one, 1j * (other - one) / abs(other - one)) for one, other in zip(points, after, strict=True)]
