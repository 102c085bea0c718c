"""A delay in cycles as the calls of a dialect, each of which the dialect's compiler knows exactly.

In: cycles and the clock. Out: call texts. XC8's `_delay` counts cycles (XC8 User's Guide, library functions,
"_delay"). C2C counts time in steps of 1 s, 1 ms, 10 us and 1 us, each argument a byte; where one step is not
whole cycles at the clock, several are; single cycles are `nop()`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

from servogen.errors import InputError
from servogen.units import Clock, Cycles

XC8_MOST = 50_463_240
"""The largest argument of `_delay`."""

C2C_MOST = 255
C2C_STEPS = (("delay_s", 1_000_000), ("delay_ms", 1000), ("delay_10us", 10), ("delay_us", 1))
"""Built-in and its step in microseconds."""

MOST_NOPS = 9


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
    """`cycles` as C2C delays and `nop()`. Raises InputError where the clock has no fitting step."""
    calls: list[Call] = []
    rest = int(cycles)
    for name, step_us in C2C_STEPS:
        multiple, step = _whole_step(step_us, clock)
        if multiple > C2C_MOST:
            continue
        most = C2C_MOST // multiple * multiple
        count = rest // step * multiple
        rest %= step
        whole, part = divmod(count, most)
        if whole:
            calls.append(Call(f"{name}({most})", whole))
        if part:
            calls.append(Call(f"{name}({part})"))
    if rest > MOST_NOPS:
        raise InputError(
            f"at {clock.hz} Hz C2C's delays cannot make {cycles} cycles: {rest} are left for nop()",
            hint='choose dialect = "xc8", whose _delay counts cycles, or another clock',
        )
    return (*calls, *([Call("nop()", rest)] if rest else []))


def _whole_step(step_us: int, clock: Clock) -> tuple[int, int]:
    """The least multiple of a step that is whole cycles, and those cycles."""
    cycles = step_us / clock.cycle_us
    return cycles.denominator, cycles.numerator


CALLS: MappingProxyType[str, Callable[[Cycles, Clock], tuple[Call, ...]]] = MappingProxyType(
    {"c2c": c2c_calls, "xc8": xc8_calls}
)
