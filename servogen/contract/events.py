"""The words of a contract: events ("RB0 falls") and conditions ("RB1 high and RB2 low") of pins.

Levels of all pins are one number, a bit for each pin of `PINS`; a pin that nothing drives counts as low.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from servogen.edges import PINS

RISES, FALLS, CHANGES = "rises", "falls", "changes"

_EVENT = re.compile(r"\s*(R[AB]\d)\s+(rises|falls|changes)\s*")
_LEVEL = re.compile(r"\s*(R[AB]\d)\s+(high|low)\s*")

EVENT_FORM = 'a pin and what it does: "RB0 rises", "RB0 falls" or "RB0 changes"'
CONDITION_FORM = 'levels of pins: "RB1 high and RB2 low"'


@dataclass(frozen=True, slots=True)
class PinEvent:
    """A change of one pin."""

    pin: int
    kind: str

    def __str__(self) -> str:
        return f"{PINS[self.pin]} {self.kind}"

    def happens(self, before: int, after: int) -> bool:
        """Return whether it happens when the levels become `after`."""
        was, is_now = before >> self.pin & 1, after >> self.pin & 1
        return was != is_now and (self.kind == CHANGES or is_now == (self.kind == RISES))


@dataclass(frozen=True, slots=True)
class PinLevels:
    """Levels that several pins have at once."""

    pins: int
    """A bit for each pin."""
    high: int
    """Those of them that are high."""

    def __str__(self) -> str:
        return " and ".join(
            f"{name} {'high' if self.high >> pin & 1 else 'low'}"
            for pin, name in enumerate(PINS)
            if self.pins >> pin & 1
        )

    def holds(self, levels: int) -> bool:
        return levels & self.pins == self.high


def event(text: str) -> PinEvent:
    """Return the event in a text. Raises ValueError."""
    found = _EVENT.fullmatch(text)
    if found is None or found[1] not in PINS:
        raise ValueError(f"'{text}' is not {EVENT_FORM}; the pins are RA0 to RA4 and RB0 to RB7")
    return PinEvent(PINS.index(found[1]), found[2])


def condition(text: str) -> PinLevels:
    """Return the condition in a text. Raises ValueError."""
    pins = high = 0
    for part in re.split(r"\band\b", text):
        found = _LEVEL.fullmatch(part)
        if found is None or found[1] not in PINS:
            raise ValueError(f"'{text}' is not {CONDITION_FORM}; the pins are RA0 to RA4 and RB0 to RB7")
        bit = 1 << PINS.index(found[1])
        if pins & bit:
            raise ValueError(f"'{text}' names {found[1]} twice")
        pins |= bit
        high |= bit if found[2] == "high" else 0
    return PinLevels(pins, high)
