"""The ports beside the arm: inputs from a stimulus, outputs as a record.

In: the values at the input port and their times. Out: its value at a frame, the next strobe; for each write
to the output port, the frame and the value.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

from servogen.errors import InputError, Location

PORT_BITS = 8


@dataclass(frozen=True, slots=True)
class Input:
    """From `at_s` seconds on, the port reads `value`; a strobe signals it to IN."""

    at_s: Fraction
    value: int


@dataclass(frozen=True, slots=True)
class Output:
    """At the beginning of `frame` the output port becomes `value`; with `strobe`, OT signals it."""

    frame: int
    value: int
    strobe: bool


_INPUT = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*=\s*(?:&([0-9A-Fa-f]{1,2})|(\d{1,3}))\s*$")


def input_of(text: str, place: Location | None = None) -> Input:
    """Return an input written as seconds=value, such as 1.5=3 or 0=&1F. Raises InputError."""
    found = _INPUT.match(text)
    value = -1 if found is None else int(found[2], 16) if found[2] else int(found[3])
    if found is None or not 0 <= value < 1 << PORT_BITS:
        raise InputError(
            "bad-option",
            f"'{text}' is not an input",
            place,
            "seconds=value, such as 1.5=3 or 0=&1F; value 0 to 255 or &0 to &FF",
        )
    return Input(Fraction(found[1]), value)


class InputPort:
    """The input port over a run: 0 until its first input."""

    def __init__(self, inputs: tuple[Input, ...], period_s: Fraction) -> None:
        ordered = sorted(inputs, key=lambda each: each.at_s)
        self._rows = tuple((-((-each.at_s) // period_s), each.value) for each in ordered)
        self._taken = 0

    def value(self, frame: int) -> int:
        """Return the value at the port in `frame`."""
        value = 0
        for first, given in self._rows:
            if first <= frame:
                value = given
        return value

    def strobe(self) -> tuple[int, int] | None:
        """Return frame and value of the first input that no strobe has returned yet; None if none is left."""
        if self._taken == len(self._rows):
            return None
        self._taken += 1
        return self._rows[self._taken - 1]
