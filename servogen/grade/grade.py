"""`Grade`: whether a program does its lab's task, why not, and what was measured of it."""

from __future__ import annotations

from dataclasses import dataclass

from servogen.errors import Diagnostic


@dataclass(frozen=True, slots=True)
class Row:
    """One position of the task and how the program holds it, over all its visits; None: never there."""

    name: str
    visits: int
    widths_us: tuple[tuple[float, float], ...]
    """Least and greatest width of each servo."""
    angles_deg: tuple[tuple[float, float], ...]
    periods_ms: tuple[float, float] | None
    stays_s: tuple[float, float] | None
    """From its first pulse to the first of the next position."""
    silent_s: tuple[float, float] | None
    """The longest time without pulses in a visit."""
    pause_s: float | None
    """What the task asks for."""

    def to_json(self) -> dict[str, object]:
        return {
            "position": self.name,
            "visits": self.visits,
            "widths_us": self.widths_us,
            "angles_deg": self.angles_deg,
            "periods_ms": self.periods_ms,
            "stays_s": self.stays_s,
            "silent_s": self.silent_s,
            "asked_pause_s": self.pause_s,
        }


@dataclass(frozen=True, slots=True)
class Grade:
    """`passed`: the program does what the lab asks for, and `reasons` is empty."""

    lab: str
    passed: bool
    reasons: tuple[str, ...]
    """Why it is not right, the most helpful first."""
    remarks: tuple[Diagnostic, ...] = ()
    """What is right, but good to know."""
    pins: tuple[tuple[str, str], ...] = ()
    """(servo, the pin that its pulses are on)."""
    rows: tuple[Row, ...] = ()
    seen: str = ""
    """The order of positions as the program has it."""
    watched_s: float = 0.0
    for_ever: bool = False
    """Whether the chip's whole state was seen to repeat, so that it goes on like this for all time."""

    def to_json(self) -> dict[str, object]:
        """Plain values for a JSON file."""
        return {
            "lab": self.lab,
            "passed": self.passed,
            "reasons": list(self.reasons),
            "remarks": [each.to_json() for each in self.remarks],
            "pins": dict(self.pins),
            "positions": [row.to_json() for row in self.rows],
            "seen": self.seen,
            "watched_s": self.watched_s,
            "for_ever": self.for_ever,
        }


def refused(lab: str, *reasons: str) -> Grade:
    """The grade of a program that could not be run."""
    return Grade(lab, False, reasons)
