"""A delay in cycles as the calls of a dialect, each of which the dialect's compiler knows exactly.

In: cycles and the clock. Out: call texts. XC8's `_delay` counts cycles (XC8 User's Guide, library functions,
"_delay"). C2C counts time in steps of 1 s, 1 ms, 10 us and 1 us, each argument a byte; what is not whole
cycles at the clock is rounded to them; single cycles are `nop()`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from types import MappingProxyType

from servogen.units import Clock, Cycles

XC8_MOST = 50_463_240
"""The largest argument of `_delay`."""

C2C_MOST = 255
C2C_STEPS = (("delay_s", 1_000_000), ("delay_ms", 1000), ("delay_10us", 10), ("delay_us", 1))
"""Built-in and its step in microseconds."""


@dataclass(frozen=True, slots=True)
class Call:
    """`times` times the same statement."""

    text: str
    times: int = 1

    def __str__(self) -> str:
        return " ".join([f"{self.text};"] * self.times)


def xc8_calls(cycles: Cycles, clock: Clock) -> tuple[Call, ...]:
    """`cycles` as `_delay` calls."""
    whole, rest = divmod(cycles, XC8_MOST)
    calls = [Call(f"_delay({XC8_MOST})", whole)] if whole else []
    return (*calls, *([Call(f"_delay({rest})")] if rest else []))


def c2c_calls(cycles: Cycles, clock: Clock) -> tuple[Call, ...]:
    """`cycles` as C2C delays and `nop()`: first in whole cycles, then in steps that C2C rounds."""
    calls: list[Call] = []
    rest = int(cycles)
    for whole_only in (True, False):
        for name, step_us in C2C_STEPS:
            while count := _most(rest, step_us, clock, whole_only):
                calls.append(Call(f"{name}({count})"))
                rest -= clock.round_us(count * step_us).cycles
    return (*_merged(calls), *([Call("nop()", rest)] if rest else []))


def _most(cycles: int, step_us: int, clock: Clock, whole_only: bool) -> int:
    """The largest argument of a step that lasts no longer than `cycles`; 0 where there is none."""
    multiple = (step_us / clock.cycle_us).denominator if whole_only else 1
    count = min(C2C_MOST, int(clock.us(cycles) / step_us)) // multiple * multiple
    while count and not 0 < clock.round_us(count * step_us).cycles <= cycles:
        count -= multiple
    return count


def _merged(calls: list[Call]) -> list[Call]:
    """The same call several times in a row as one."""
    return [Call(text, len(list(same))) for text, same in groupby(call.text for call in calls)]


CALLS: MappingProxyType[str, Callable[[Cycles, Clock], tuple[Call, ...]]] = MappingProxyType(
    {"c2c": c2c_calls, "xc8": xc8_calls}
)
