"""`Unreachable`: a target that no joint position reaches; it says why and which point is nearest."""

from __future__ import annotations

from collections.abc import Sequence

from servogen.errors import InputError, Place


class Unreachable(InputError):
    """No solution: `reason` says why, `nearest` is the nearest reachable point in metres."""

    def __init__(
        self, target: Sequence[float], reason: str, nearest: Sequence[float], place: Place | None = None
    ) -> None:
        self.target = tuple(float(value) for value in target)
        self.reason = reason
        self.nearest = tuple(float(value) for value in nearest)
        super().__init__(
            f"the point {in_mm(self.target)} cannot be reached: {reason}",
            place,
            f"the nearest reachable point is {in_mm(self.nearest)}",
        )

    def at(self, place: Place) -> Unreachable:
        """The same error at a place of a file."""
        return Unreachable(self.target, self.reason, self.nearest, place)


def in_mm(point: Sequence[float]) -> str:
    """A point in metres as text in millimetres."""
    return "(" + ", ".join(f"{round(1000 * value, 3) + 0.0:.3f}" for value in point) + ") mm"
