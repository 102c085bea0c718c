"""`Unreachable`: a target that no joint position reaches, with the reason and the nearest point."""

from __future__ import annotations

import math
from collections.abc import Sequence

from servogen.errors import Location, ServogenError


class Unreachable(ServogenError):
    """A target without a solution: `reason` says why, `nearest` is the nearest reachable point in metres.

    `as_asked`: whether it is reached in the requested orientation, or with the wrist at home if none is
    given.
    """

    def __init__(
        self,
        target: Sequence[float],
        reason: str,
        nearest: Sequence[float],
        place: Location | None = None,
        as_asked: bool = True,
    ) -> None:
        self.target = tuple(float(value) for value in target)
        self.reason = reason
        self.nearest = tuple(float(value) for value in nearest)
        self.as_asked = as_asked
        super().__init__(
            "out-of-reach",
            f"the point {in_mm(self.target)} cannot be reached: {reason}",
            place,
            self._advice(),
        )

    def _advice(self) -> str:
        near = in_mm(self.nearest)
        if near == in_mm(self.target) and self.as_asked:
            away = math.dist(self.nearest, self.target)
            return f"the nearest reachable point is {1000 * away:.2g} mm away"
        if self.as_asked:
            return f"the nearest reachable point is {near}"
        if near == in_mm(self.target):
            return "the point can be reached in another orientation"
        return f"the nearest reachable point is {near}, in another orientation"


def in_mm(point: Sequence[float]) -> str:
    """Return a point in metres as text in millimetres."""
    return "(" + ", ".join(f"{1000 * value:z.3f}" for value in point) + ") mm"
