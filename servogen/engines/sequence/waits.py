"""A delay in cycles as calls of a dialect, whose times its compiler knows exactly.

In: cycles and the clock. Out: call texts. XC8's `_delay` counts cycles (XC8 User's Guide, library functions,
"_delay"). C2C counts time in steps of 1 s, 1 ms, 10 us and 1 us, each argument a byte; what is not whole
cycles at the clock is rounded to them; single cycles are `nop()`. SDCC has no delays: `templates/sdcc.j2`
implements them in assembly, whose cycles do not depend on the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from math import gcd
from types import MappingProxyType

from servogen.units import OSCILLATOR_PERIODS_PER_CYCLE, Clock, Cycles

XC8_MAX = 50_463_240
"""The largest argument of `_delay`."""

C2C_MAX = 255
C2C_STEPS = (("delay_s", 1_000_000), ("delay_ms", 1000), ("delay_10us", 10), ("delay_us", 1))
"""Built-in functions and their steps in microseconds."""

SDCC_MIN, SDCC_STEP, SDCC_MAX = 14, 4, 250_000
"""The arguments that `wait` of `templates/sdcc.j2` takes."""
SDCC_LONG, SDCC_LONG_MIN, SDCC_LONG_MAX = 200_000, 5, 255
"""Cycles of each turn of `wait_long`, of its call, and its largest argument."""


@dataclass(frozen=True, slots=True)
class RepeatedCall:
    """The same statement, repeated `times` times."""

    text: str
    times: int = 1

    def __str__(self) -> str:
        return " ".join([f"{self.text};"] * self.times)


def xc8_calls(cycles: Cycles, clock: Clock) -> tuple[RepeatedCall, ...]:
    """Return `cycles` as `_delay` calls."""
    whole, rest = divmod(cycles, XC8_MAX)
    calls = [RepeatedCall(f"_delay({XC8_MAX})", whole)] if whole else []
    return (*calls, *([RepeatedCall(f"_delay({rest})")] if rest else []))


def c2c_calls(cycles: Cycles, clock: Clock) -> tuple[RepeatedCall, ...]:
    """Return `cycles` as C2C delays and `nop()`: first in whole cycles, then in steps that C2C rounds."""
    calls: list[RepeatedCall] = []
    rest = int(cycles)
    for whole_only in (True, False):
        for name, step_us in C2C_STEPS:
            while count := _maximum(rest, step_us, clock, whole_only):
                calls.append(RepeatedCall(f"{name}({count})"))
                rest -= clock.round_us(count * step_us).cycles
    return (*_merged(calls), *([RepeatedCall("nop()", rest)] if rest else []))


def _maximum(cycles: int, step_us: int, clock: Clock, whole_only: bool) -> int:
    """Return the largest argument of a step that lasts no longer than `cycles`; 0 if there is none."""
    periods, per_step = cycles * OSCILLATOR_PERIODS_PER_CYCLE * 1_000_000, clock.hz * step_us
    whole = OSCILLATOR_PERIODS_PER_CYCLE * 1_000_000
    multiple = whole // gcd(per_step, whole) if whole_only else 1
    return min(C2C_MAX, periods // per_step) // multiple * multiple


def _merged(calls: list[RepeatedCall]) -> list[RepeatedCall]:
    """Return equal successive calls as one."""
    return [RepeatedCall(text, len(list(same))) for text, same in groupby(call.text for call in calls)]


def sdcc_calls(cycles: Cycles, clock: Clock) -> tuple[RepeatedCall, ...]:
    """Return `cycles` as `wait_long`, `wait` and `nop()`."""
    calls: list[RepeatedCall] = []
    rest = int(cycles)
    while rest > SDCC_MAX:
        turns = min((rest - SDCC_LONG_MIN) // SDCC_LONG, SDCC_LONG_MAX)
        calls.append(RepeatedCall(f"wait_long({turns})"))
        rest -= SDCC_LONG * turns + SDCC_LONG_MIN
    if rest >= SDCC_MIN:
        waited = rest - (rest - SDCC_MIN) % SDCC_STEP
        calls.append(RepeatedCall(f"wait({waited})"))
        rest -= waited
    return (*_merged(calls), *([RepeatedCall("nop()", rest)] if rest else []))


CALLS: MappingProxyType[str, Callable[[Cycles, Clock], tuple[RepeatedCall, ...]]] = MappingProxyType(
    {"c2c": c2c_calls, "xc8": xc8_calls, "sdcc": sdcc_calls}
)
