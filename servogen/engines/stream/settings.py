"""The settings of a serial line, and whether the chip can receive it at its clock.

In: the values of [stream]. Out: `Stream`; InputError for a baud rate that the chip cannot receive at its
clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from servogen.engines.stream.protocol import BITS
from servogen.errors import InputError, Location
from servogen.units import Clock

UNIT = 4
"""Cycles per unit of the receiver's clock; a bit's time is one byte of these."""
MAX_UNITS = 255 - 32
"""A byte minus the longest time between two samples."""

SAMPLE_GAP = 120
"""The greatest number of cycles between two of the three samples of the line in a round of the timer."""

BAUD_ERROR = Fraction(2, 100)
"""The error allowed of a sender's rate."""

HOLD, NEUTRAL, OFF = "hold", "neutral", "off"


@dataclass(frozen=True, slots=True)
class Stream:
    """The serial line's rate and pins; after `silence_s` without a command the fail-safe comes."""

    baud: int = 2400
    receive_pin: str = "RA4"
    transmit_pin: str | None = None
    silence_s: Fraction = Fraction(1)
    fail_safe: str = NEUTRAL
    """HOLD: positions are held; NEUTRAL: to the neutral pose; OFF: no more pulses."""
    place: Location | None = None


USUAL = (300, 600, 1200, 2400, 4800, 9600, 14_400, 19_200, 38_400)
"""The rates that are suggested when another is refused."""


def bit_units(stream: Stream, clock: Clock) -> int:
    """Return a bit in units of 4 cycles, rounded. Raises InputError if the line cannot be received.

    A bit is sampled in its middle, give or take half the time between two samples, both for the start bit and
    for itself; up to the stop bit the rounding to units adds up nine times, and a sender that is 2 % off
    drifts by 0.19 bits. Together it must stay below half a bit.
    """
    bit = clock.cycles_per_second / stream.baud
    units, rounding, drift = _off(bit)
    if SAMPLE_GAP + rounding + drift >= bit / 2:
        parts = round(rounding, 1), round(drift, 1)
        raise InputError(
            "baud-rate",
            f"{stream.baud} baud at {clock.hz} Hz: a bit is {float(bit):.1f} cycles, it is looked at up to "
            f"{float(SAMPLE_GAP + sum(parts)):.1f} from its middle: {SAMPLE_GAP} between two looks + "
            f"{float(parts[0]):.1f} for bits of {units * UNIT} cycles + {float(parts[1]):.1f} for a sender "
            f"{float(100 * BAUD_ERROR):g} % off; half a bit is {float(bit / 2):.1f}",
            stream.place,
            _rates(clock),
        )
    if units > MAX_UNITS:
        raise InputError(
            "baud-rate",
            f"{stream.baud} baud at {clock.hz} Hz: a bit is {float(bit):.1f} cycles, the receiver counts "
            f"{MAX_UNITS * UNIT} at most",
            stream.place,
            _rates(clock),
        )
    return units


def _off(bit: Fraction) -> tuple[int, Fraction, Fraction]:
    """Return a bit's units, and how far rounding and the sender's error move the stop bit, in cycles."""
    units = round(bit / UNIT)
    return units, abs(units * UNIT - bit) * (BITS - 1), bit * BAUD_ERROR * (2 * BITS - 1) / 2


def _rates(clock: Clock) -> str:
    """Return the usual rates that this clock can receive, as text."""
    rates = []
    for baud in USUAL:
        bit = clock.cycles_per_second / baud
        units, rounding, drift = _off(bit)
        if SAMPLE_GAP + rounding + drift < bit / 2 and units <= MAX_UNITS:
            rates.append(str(baud))
    return (
        f"at this clock: {', '.join(rates)} baud"
        if rates
        else "no usual rate goes with this clock: take another"
    )
