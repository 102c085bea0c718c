"""Warnings: what the program did that is worth a look, in words.

In: what the instruction loop noted in the state vector (`warn.py`). Out: frozen values, in order of cycles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS
from servogen.pic.image import Image
from servogen.simulator import layout as at
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class Warning:
    """Something that the program did first in `cycle`."""

    cycle: Cycles
    kind: str
    message: str

    def __str__(self) -> str:
        return f"cycle {self.cycle}: {self.message}"


_NO_CONFIGURATION = Warning(
    Cycles(0),
    "no-configuration",
    "the image has no configuration word: as on an erased chip the oscillator is RC and the watchdog is on",
)

_WORDS = {
    at.WARN_DRIVEN_UNWRITTEN: (
        "driven-before-written",
        "{pins}: an output before its port was ever written; its latch, unknown at power-up, is taken as 0",
    ),
    at.WARN_CONTENTION: ("contention", "{pins}: an output, and driven the other way from outside"),
    at.WARN_UNDEFINED: (
        "undefined-word",
        "the word at {address} is no instruction of the data sheet; it was executed as NOP",
    ),
    at.WARN_ERASED: ("erased-word", "the program ran into the unprogrammed word at {address} (ADDLW 0xFF)"),
    at.WARN_STACK_OVERFLOW: ("stack-overflow", "a ninth return address was pushed: the stack wrapped"),
    at.WARN_STACK_UNDERFLOW: ("stack-underflow", "a return with an empty stack: the stack wrapped"),
    at.WARN_EE_SEQUENCE: (
        "eeprom-sequence",
        "WR was set without WREN or without the sequence 55h, AAh, WR just before: nothing is written",
    ),
    at.WARN_EE_ADDRESS: ("eeprom-address", "EEADR is {address}; the EEPROM ends at 0x03F"),
}
_OF_PINS = (at.WARN_DRIVEN_UNWRITTEN, at.WARN_CONTENTION)


def warnings_of(s: npt.NDArray[np.int64], image: Image) -> tuple[Warning, ...]:
    """The warnings in a state vector; pins that one instruction brought in trouble are one warning."""
    told: dict[tuple[int, int, int], list[str]] = {}
    for code, subject, cycle in noted(s):
        if code in _OF_PINS:
            told.setdefault((code, cycle, 0), []).append(PINS[subject])
        else:
            told[code, cycle, subject] = []
    found = [_NO_CONFIGURATION] if image.config is None else []
    for (code, cycle, subject), pins in told.items():
        kind, text = _WORDS[code]
        message = text.format(pins=", ".join(pins), address=f"0x{subject:03X}")
        found.append(Warning(Cycles(cycle), kind, message))
    return tuple(found)


def noted(s: npt.NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """What a vector has noted: (code, subject, cycle)."""
    pairs = s[at.WARNINGS : at.WARNINGS + 2 * int(s[at.WARN_COUNT])].reshape(-1, 2)
    return [(int(key) >> 16, int(key) & 0xFFFF, int(cycle)) for key, cycle in pairs]


def subjects(s: npt.NDArray[np.int64], code: int) -> tuple[int, ...]:
    """The pins or addresses that one kind of warning is about."""
    return tuple(sorted(subject for noted_code, subject, _ in noted(s) if noted_code == code))
