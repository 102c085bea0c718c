"""A delay in a dialect's calls is the delay asked for, to the cycle."""

import re
from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.csource.waits import CALLS, XC8_MOST
from servogen.units import Clock, Cycles

STEP_US = {"delay_us": 1, "delay_10us": 10, "delay_ms": 1000, "delay_s": 1_000_000}
"""What C2C's manual calls each step, typed here a second time."""

CLOCKS = (4_000_000, 8_000_000, 10_000_000, 20_000_000, 1_000_000, 3_579_545, 3_686_400, 32_768)


def cycles_of(text: str, hz: int) -> int:
    """What a line of C asks for, by the meaning of each call, each rounded to whole cycles."""
    total = 0
    for name, argument in re.findall(r"(\w+)\((\d*)\);", text):
        if name == "nop":
            total += 1
        elif name == "_delay":
            total += int(argument)
        else:
            assert int(argument) <= 255
            exact = int(argument) * STEP_US[name] * Fraction(hz, 4_000_000)
            total += int(exact + Fraction(1, 2))
    return total


@settings(derandomize=True, max_examples=300)
@given(st.integers(0, 40_000_000), st.sampled_from(CLOCKS))
def test_the_calls_of_a_delay_last_as_many_cycles_as_asked(cycles: int, hz: int) -> None:
    for dialect, calls in CALLS.items():
        text = " ".join(str(call) for call in calls(Cycles(cycles), Clock(hz)))
        assert cycles_of(text, hz) == cycles, (dialect, text)


def test_no_cycles_need_no_call() -> None:
    assert all(calls(Cycles(0), Clock(4_000_000)) == () for calls in CALLS.values())


def test_the_pulse_of_45_degrees_is_1250_us_in_both_dialects() -> None:
    clock = Clock(4_000_000)
    assert [str(call) for call in CALLS["c2c"](Cycles(1250), clock)] == ["delay_ms(1);", "delay_10us(25);"]
    assert [str(call) for call in CALLS["xc8"](Cycles(1250), clock)] == ["_delay(1250);"]


def test_a_delay_beyond_the_largest_argument_is_split() -> None:
    (most, rest) = CALLS["xc8"](Cycles(XC8_MOST + 7), Clock(4_000_000))
    assert (most.text, rest.text) == (f"_delay({XC8_MOST})", "_delay(7)")


def test_few_calls_are_needed_at_any_clock() -> None:
    for hz in CLOCKS:
        for cycles in range(0, 3000, 7):
            calls = CALLS["c2c"](Cycles(cycles), Clock(hz))
            assert sum(call.times for call in calls) <= 16, (hz, cycles, calls)
