"""Time as a typed integer: `Cycles` of an oscillator's `Clock`.

In: an oscillator frequency in hertz. Out: exact conversions between instruction cycles and microseconds;
counts with their nouns.
One instruction cycle (Tcy) is four oscillator periods (DS35007, section 2.2 "Clocking scheme").
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import NewType

Cycles = NewType("Cycles", int)
"""A number of instruction cycles, or the instruction cycle since reset in which something happens."""

OSCILLATOR_PERIODS_PER_CYCLE = 4


@dataclass(frozen=True, slots=True)
class Rounded:
    """A requested time in microseconds and the nearest one in whole cycles."""

    requested_us: Fraction
    cycles: Cycles
    achieved_us: Fraction

    @property
    def error_us(self) -> Fraction:
        return self.achieved_us - self.requested_us

    @property
    def exact(self) -> bool:
        return self.achieved_us == self.requested_us


@dataclass(frozen=True, slots=True)
class Clock:
    """An oscillator of `hz` hertz; four of its periods are one instruction cycle."""

    hz: int

    def __post_init__(self) -> None:
        if self.hz <= 0:
            raise ValueError(f"a clock needs a positive frequency, not {self.hz} Hz")

    @property
    def cycles_per_second(self) -> Fraction:
        return Fraction(self.hz, OSCILLATOR_PERIODS_PER_CYCLE)

    @property
    def cycle_us(self) -> Fraction:
        """Return the length of an instruction cycle in µs."""
        return 1_000_000 / self.cycles_per_second

    def us(self, cycles: int) -> Fraction:
        """Return the exact time of `cycles` in µs."""
        return cycles * self.cycle_us

    def seconds(self, cycles: int) -> Fraction:
        return cycles / self.cycles_per_second

    def round_us(self, us: Fraction | float) -> Rounded:
        """Return the number of cycles nearest to `us` microseconds; halves are rounded up."""
        requested = Fraction(us)
        cycles = Cycles(_nearest(requested / self.cycle_us))
        return Rounded(requested, cycles, self.us(cycles))

    def round_seconds(self, seconds: Fraction | float) -> Cycles:
        """Return the number of cycles nearest to `seconds`; halves are rounded up."""
        return Cycles(_nearest(Fraction(seconds) * self.cycles_per_second))


def counted(number: int, noun: str) -> str:
    """Return a count with its noun: `1 cycle`, `2 cycles`, `3 glitches`."""
    plural = "es" if noun.endswith("ch") else "s"
    return f"{number} {noun}{'' if number == 1 else plural}"


def _nearest(value: Fraction) -> int:
    return (2 * value.numerator + value.denominator) // (2 * value.denominator)
