"""A serial line that commands positions."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from servogen.errors import Location

HOLD, NEUTRAL, OFF = "hold", "neutral", "off"


@dataclass(frozen=True, slots=True)
class Stream:
    """The serial line's rate and pins; after `silence_s` without a command the fail-safe takes effect."""

    kind: ClassVar[str] = "a serial line"

    baud: int = 2400
    receive_pin: str = "RA4"
    transmit_pin: str | None = None
    silence_s: Fraction = Fraction(1)
    fail_safe: str = NEUTRAL
    """HOLD: positions are held; NEUTRAL: to the neutral pose; OFF: no more pulses."""
    place: Location | None = None
