"""What a job says of its serial line, and whether the chip can receive it at its clock.

In: [stream]'s values. Out: `Stream`; InputError for a baud rate that does not go with the clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from servogen.errors import InputError, Place
from servogen.pulse.stream.protocol import BITS
from servogen.units import Clock

UNIT = 4
"""Cycles of the receiver's clock: a bit's time is counted in one byte of these."""
MOST_UNITS = 255 - 32
"""What is left of a byte when the longest time between two samples is taken off."""

SAMPLE_GAP = 120
"""Cycles between two looks at the line: three in a round of the timer, as far apart as can be."""

BAUD_ERROR = Fraction(2, 100)
"""How wrong a sender's rate may be."""

HOLD, NEUTRAL, OFF = "hold", "neutral", "off"


@dataclass(frozen=True, slots=True)
class Stream:
    """The serial line's rate and pins; after `silence_s` without a command the fail-safe comes."""

    baud: int = 2400
    receive_pin: str = "RA4"
    transmit_pin: str | None = None
    silence_s: Fraction = Fraction(1)
    fail_safe: str = NEUTRAL
    """HOLD: as they are; NEUTRAL: to the neutral pose; OFF: no more pulses."""
    place: Place | None = None


def bit_units(stream: Stream, clock: Clock) -> int:
    """A bit in units of 4 cycles, rounded. Raises InputError where the line cannot be received.

    A bit is looked at in its middle, give or take half the time between two looks, for the start bit as for
    itself; until the stop bit a sender that is 2 % off has drifted by 0.19 bits. Together it must stay below
    half a bit.
    """
    bit = clock.cycles_per_second / stream.baud
    units = round(bit / UNIT)
    rounding = abs(units * UNIT - bit) * (BITS - 1)
    drift = bit * BAUD_ERROR * (2 * BITS - 1) / 2
    worst = SAMPLE_GAP + rounding + drift
    if worst >= bit / 2:
        raise InputError(
            f"{stream.baud} baud at {clock.hz} Hz: a bit is {float(bit):.1f} cycles, it is looked at up to "
            f"{float(worst):.0f} from its middle ({SAMPLE_GAP} between two looks, {float(drift):.0f} for a "
            f"sender 2 % off), and half a bit is {float(bit / 2):.0f}",
            stream.place,
            "2400 baud from 4 MHz on, 4800 from 8 MHz on, 9600 from 16 MHz on",
        )
    if units > MOST_UNITS:
        raise InputError(
            f"{stream.baud} baud at {clock.hz} Hz: a bit is {float(bit):.1f} cycles, the receiver counts "
            f"{MOST_UNITS * UNIT} at most",
            stream.place,
            "a higher rate, or a slower clock",
        )
    return units
