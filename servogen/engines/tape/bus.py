"""How long the reader waits for the EEPROM, in cycles beside its own instructions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from servogen.simulator.eeprom24 import HIGH_TIME, LOW_TIME
from servogen.units import Clock, Cycles

HIGH_CYCLES, LOW_CYCLES, READING_CYCLES = 1, 2, 4
"""The fewest cycles for which SCL is high or low without a wait, and high in a bit that is read."""
BITS = 9
BYTE_C, SEEK_C = 110, 1000
"""The cycles reserved for a byte of a frame, without waits, and for the way back to the loop; what the C
takes is counted once it is compiled."""
SEEK_BYTES = 4
INPUTS_C = 200
"""The cycles reserved for the inputs of a frame and the choice of what follows it."""


@dataclass(frozen=True, slots=True)
class Waits:
    """The cycles by which each phase of the clock is longer than the instructions make it."""

    low: int
    high: int
    high_reading: int

    @classmethod
    def at(cls, clock: Clock) -> Waits:
        """Return the waits for parameters THIGH and TLOW of the data sheet."""

        def more(ns: int, cycles: int) -> int:
            return max(0, math.ceil(Fraction(ns, 10**9) * clock.cycles_per_second) - cycles)

        return cls(
            more(LOW_TIME.ns, LOW_CYCLES),
            more(HIGH_TIME.ns, HIGH_CYCLES),
            more(HIGH_TIME.ns, READING_CYCLES),
        )

    def reserve(self, servos: int, *, steered: bool) -> Cycles:
        """Return the cycles reserved between two frames: the longest record, before it the way back, and what
        is read of inputs.
        """
        bytes_read, bit = 2 * servos + 4, self.low + self.high
        return Cycles(
            bytes_read * (BYTE_C + BITS * bit)
            + SEEK_C
            + SEEK_BYTES * BITS * (2 * self.low + self.high)
            + INPUTS_C * steered
        )
