"""Sampling rates: as written in sigrok's files, and as the clock of a trace whose cycles are time steps."""

from __future__ import annotations

import re
from fractions import Fraction

from servogen.errors import InputError, Location
from servogen.units import OSCILLATOR_PERIODS_PER_CYCLE, Clock

_RATE = re.compile(r"(\d{1,18}(?:\.\d{1,18})?)\s*([kMG]?)Hz")
_FACTOR = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9}


def rate_in(text: str) -> Fraction | None:
    """Return the sampling rate in hertz given in `text`: `200 kHz`, `1.5 MHz`."""
    found = _RATE.search(text)
    return Fraction(found.group(1)) * _FACTOR[found.group(2)] if found else None


def step_clock(steps_per_second: Fraction, place: Location) -> Clock:
    """Return the clock whose instruction cycle is one time step."""
    hz = steps_per_second * OSCILLATOR_PERIODS_PER_CYCLE
    if hz <= 0 or hz.denominator != 1:
        raise InputError(
            "bad-rate", f"{float(steps_per_second):g} time steps per second are not a whole number", place
        )
    return Clock(int(hz))
