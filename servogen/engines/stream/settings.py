"""Whether the chip can receive a serial line at its clock, and how its receiver counts.

In: a `Stream`. Out: units of the receiver's time; InputError for a baud rate that cannot be received.
"""

from __future__ import annotations

import math
from fractions import Fraction

from servogen.engines.inputs.serial import Stream
from servogen.engines.stream.protocol import BITS
from servogen.errors import InputError
from servogen.units import Clock

UNIT = 4
"""Cycles per unit of the receiver's clock; a bit's time is one byte of these."""
MAX_UNITS = 255 - 32
"""The maximum units of a bit: a byte minus the longest time between two samples."""

START_GAP, BIT_GAP = 114, 129
"""The usual maximum of cycles between two samples of the line: before a start bit, and within a byte.

Beside a late pulse they can be further apart (docs/firmware.md).
"""
MASKED = 9
"""Cycles by which a write to the EEPROM can delay one sample of a byte (templates/stream/keep.asm)."""
STAMP = 2
"""Cycles from the sample that sees a start bit to the reading of the time that belongs to it."""
SAMPLE_AFTER = (20, 30)
"""The minimum and maximum cycles from the reading of the time to the sample of a bit."""
STOP_AFTER = 22
"""The maximum cycles from the reading of the time to the sample of the stop bit."""

BAUD_ERROR = Fraction(2, 100)
"""The allowed relative error of a sender's rate."""

USUAL = (300, 600, 1200, 2400, 4800, 9600, 14_400, 19_200, 38_400)
"""The rates that are suggested when another one is refused."""


def bit_units(stream: Stream, clock: Clock) -> int:
    """Return a bit in units of 4 cycles, rounded. Raises InputError if the line cannot be received.

    Every bit of a sender that is up to 2 % off must be sampled while it is on the line: see `_windows`.
    """
    bit = clock.cycles_per_second / stream.baud
    units, (first, last) = round(bit / UNIT), _windows(bit)
    if first > last:
        latest, end = _latest_sample(bit, BITS - 1, first), BITS * bit / (1 + BAUD_ERROR)
        raise InputError(
            "baud-rate",
            f"{stream.baud} baud at {clock.hz} Hz: a bit is {float(bit):.1f} cycles; samples are usually "
            f"up to {START_GAP} cycles apart before a start bit and {BIT_GAP} after it, so that the stop bit "
            f"of a sender {float(100 * BAUD_ERROR):g} % off is sampled up to {latest} cycles after the byte "
            f"began, and ends after {float(end):.1f}",
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


def first_units(bit: Fraction) -> int:
    """Return the receiver's units of time from the start bit's time stamp to its own sample."""
    first, last = _windows(bit)
    return (first + last) // 2


def _windows(bit: Fraction) -> tuple[int, int]:
    """Return the minimum and maximum `first_units` for which each bit is sampled within its time.

    Bit k (0: the start bit, 9: the stop bit) is sampled at the first look at which more than `first_units`
    and k times a bit's units have passed since the start bit's time stamp. A time stamp is rounded down to
    units.

        line   ▔▔▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁ …             bit k lasts from k · bit to (k + 1) · bit
        looks    |       |       |               the first is up to START_GAP after the edge
                       stamp   sample            of the first look after it is due, up to BIT_GAP later
    """
    units = round(bit / UNIT)
    slow, fast = bit / (1 - BAUD_ERROR), bit / (1 + BAUD_ERROR)
    soonest, rounding = SAMPLE_AFTER[0], UNIT - 1
    first = max(
        math.ceil((k * slow - STAMP - soonest - UNIT * (1 + k * units) + rounding) / UNIT)
        for k in range(1, BITS)
    )
    last = MAX_UNITS
    # A larger `first` only moves samples later, so the search downwards ends at the maximum.
    while last >= 0 and any(_latest_sample(bit, k, last) > (k + 1) * fast for k in range(BITS)):
        last -= 1
    return max(0, first), last


def _latest_sample(bit: Fraction, k: int, first: int) -> int:
    """Return the maximum cycles from the beginning of a byte to the sample of bit k."""
    due = UNIT * (first + 1 + k * round(bit / UNIT)) - 1
    after = STOP_AFTER if k == BITS - 1 else SAMPLE_AFTER[1]
    return START_GAP + STAMP + due + BIT_GAP + MASKED + after


def _rates(clock: Clock) -> str:
    """Return the usual rates that this clock can receive, as text."""
    rates = []
    for baud in USUAL:
        bit = clock.cycles_per_second / baud
        first, last = _windows(bit)
        if first <= last and round(bit / UNIT) <= MAX_UNITS:
            rates.append(str(baud))
    return (
        f"at this clock: {', '.join(rates)} baud"
        if rates
        else "no usual rate is possible with this clock: use another one"
    )
