"""A delay in a dialect's calls is the delay asked for, to the cycle."""

import re
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.csource.waits import CALLS, XC8_MOST
from servogen.errors import InputError
from servogen.units import Clock, Cycles

STEP_US = {"delay_us": 1, "delay_10us": 10, "delay_ms": 1000, "delay_s": 1_000_000}
"""What C2C's manual calls each step, typed here a second time."""

CLOCKS = (4_000_000, 8_000_000, 10_000_000, 20_000_000, 1_000_000, 3_579_545)


def cycles_of(text: str, hz: int) -> Fraction:
    """What a line of C asks for, by the meaning of each call."""
    total = Fraction(0)
    for name, argument in re.findall(r"(\w+)\((\d*)\);", text):
        if name == "nop":
            total += 1
        elif name == "_delay":
            total += int(argument)
        else:
            assert int(argument) <= 255
            total += int(argument) * STEP_US[name] * Fraction(hz, 4_000_000)
    return total


@settings(derandomize=True, max_examples=300)
@given(st.integers(0, 40_000_000), st.sampled_from(CLOCKS[:4]))
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


def test_a_clock_that_c2c_has_no_step_for_is_refused_with_the_way_out() -> None:
    with pytest.raises(InputError, match="3579545 Hz C2C's delays cannot make 1000 cycles") as caught:
        CALLS["c2c"](Cycles(1000), Clock(3_579_545))
    assert "xc8" in str(caught.value)
