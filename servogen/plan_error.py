"""`PlanError`: how far a schedule's pulses are from the motion that they were rounded from.

Every width is whole cycles of the chip, and an engine may encode it more coarsely still. Edges are compared
with the schedule; this is the distance from there to what was planned.
"""

from __future__ import annotations

from dataclasses import dataclass

NO_PLAN = "no plan to compare with"
"""Describes a schedule that was written by hand or measured: nothing says what it was rounded from."""

DECIMALS = 3
"""Of every number: a nanosecond and a micrometre are far below what a servo resolves."""


@dataclass(frozen=True, slots=True)
class PlanError:
    """The largest distances over all frames and servos; None where the motion has nothing of that kind."""

    width_us: float
    angle_deg: float | None = None
    speed_deg_s: float | None = None
    """Of continuous-rotation servos, whose width is a speed."""
    end: str | None = None
    """The foot, tool or base that is farthest from its planned place."""
    end_mm: float | None = None

    def text(self) -> str:
        """Return the distances as one phrase: 19.008 µs, 6.843°, 7.223 mm at the foot L1."""
        parts = [f"{self.width_us:g} µs"]
        if self.angle_deg is not None:
            parts.append(f"{self.angle_deg:g}°")
        if self.speed_deg_s is not None:
            parts.append(f"{self.speed_deg_s:g}°/s")
        if self.end is not None:
            parts.append(f"{self.end_mm:g} mm at the {self.end}")
        return ", ".join(parts)

    def to_json(self) -> dict[str, object]:
        """Return plain values for a JSON file."""
        return {
            "width_us": self.width_us,
            "angle_deg": self.angle_deg,
            "speed_deg_s": self.speed_deg_s,
            "end": self.end,
            "end_mm": self.end_mm,
        }


def plan_words(error: PlanError | None) -> str:
    """Return how far a schedule is from its plan, as the end of a verdict's first line."""
    return NO_PLAN if error is None else f"the schedule is within {error.text()} of the plan"
