"""`PlanError`: how far a schedule's pulses are from the motion that they were rounded from.

Every width is rounded to whole cycles of the chip, and an engine may encode it even more coarsely. Edges are
compared with the schedule; `PlanError` is the distance from the schedule to the plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from servogen.answers import PlanErrorAnswer

NO_PLAN = "no plan to compare with"
"""Describes a schedule that was written by hand or measured, of which no plan is known."""

DECIMALS = 3
"""Decimals of every number: a nanosecond and a micrometre are far below a servo's resolution."""


@dataclass(frozen=True, slots=True)
class PlanError:
    """The maximum distances over all frames and servos; None if the motion has no such quantity."""

    width_us: float
    angle_deg: float | None = None
    speed_deg_s: float | None = None
    """For continuous-rotation servos, whose width is a speed."""
    end: str | None = None
    """The foot, tool or base that is farthest from its planned position."""
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

    def to_json(self) -> PlanErrorAnswer:
        """Return the error as a value that JSON can hold."""
        return {
            "width_us": self.width_us,
            "angle_deg": self.angle_deg,
            "speed_deg_s": self.speed_deg_s,
            "end": self.end,
            "end_mm": self.end_mm,
        }


def plan_text(error: PlanError | None) -> str:
    """Return the distance of a schedule from its plan in words, for the end of a verdict's first line."""
    return NO_PLAN if error is None else f"the schedule is within {error.text()} of the plan"
