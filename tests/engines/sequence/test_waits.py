"""A delay in a dialect's calls is the delay asked for, to the cycle."""

import re
from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.compiler import Options, Source, compile_sources
from servogen.edges import join
from servogen.engines.c_text import environment
from servogen.engines.sequence.waits import CALLS, XC8_MAX
from servogen.simulator import simulate
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
        elif name == "wait":
            assert 14 <= int(argument) <= 250_000 and int(argument) % 4 == 2
            total += int(argument)
        elif name == "wait_long":
            assert 1 <= int(argument) <= 255
            total += 200_000 * int(argument) + 5
        else:
            assert int(argument) <= 255
            exact = int(argument) * STEP_US[name] * Fraction(hz, 4_000_000)
            total += int(exact + Fraction(1, 2))
    return total


@settings(max_examples=300)
@given(st.integers(0, 40_000_000), st.sampled_from(CLOCKS))
def test_the_calls_of_a_delay_last_as_many_cycles_as_asked(cycles: int, hz: int) -> None:
    for dialect, calls in CALLS.items():
        text = " ".join(str(call) for call in calls(Cycles(cycles), Clock(hz)))
        assert cycles_of(text, hz) == cycles, (dialect, text)


def test_no_cycles_need_no_call() -> None:
    assert all(calls(Cycles(0), Clock(4_000_000)) == () for calls in CALLS.values())


def test_the_pulse_of_45_degrees_is_1250_us_in_all_dialects() -> None:
    clock = Clock(4_000_000)
    assert [str(call) for call in CALLS["c2c"](Cycles(1250), clock)] == ["delay_ms(1);", "delay_10us(25);"]
    assert [str(call) for call in CALLS["xc8"](Cycles(1250), clock)] == ["_delay(1250);"]
    assert [str(call) for call in CALLS["sdcc"](Cycles(1250), clock)] == ["wait(1250);"]


def test_a_delay_beyond_the_largest_argument_is_split() -> None:
    (most, rest) = CALLS["xc8"](Cycles(XC8_MAX + 7), Clock(4_000_000))
    assert (most.text, rest.text) == (f"_delay({XC8_MAX})", "_delay(7)")


def test_few_calls_are_needed_at_any_clock() -> None:
    for hz in CLOCKS:
        for cycles in range(0, 3000, 7):
            calls = CALLS["c2c"](Cycles(cycles), Clock(hz))
            assert sum(call.times for call in calls) <= 16, (hz, cycles, calls)


LENGTHS = (
    1,
    13,
    14,
    15,
    17,
    18,
    1013,
    1014,
    1015,
    1250,
    19_999,
    249_998,
    250_000,
    250_001,
    450_003,
    2_000_000,
)


def test_sdccs_waits_compiled_take_the_cycles_that_they_say() -> None:
    """`PORTB = 1; wait; PORTB = 0;` is high for the wait and the cycle of CLRF."""
    clock = Clock(4_000_000)
    words = {"device": "PIC16F84", "oscillator": "XT", "clock_hz": clock.hz, "long_waits": True}
    waits = [" ".join(str(call) for call in CALLS["sdcc"](Cycles(cycles), clock)) for cycles in LENGTHS]
    body = "".join(f"PORTB = 0x01; {wait} PORTB = 0x00;\n" for wait in waits)
    spoken = '{% import "sdcc.j2" as say with context %}{{ say.header() }}{{ say.waiting(long_waits) }}'
    text = environment().from_string(spoken).render(words)
    main = f"{text}\nvoid main(void)\n{{\nTRISB = 0xFE;\n{body}while (1) ;\n}}\n"
    made = compile_sources([Source(main, "main.c")], Options(dialect="sdcc"))
    edges = join(simulate(made.image, clock, Cycles(sum(LENGTHS) + 10_000)).edges.driven()).cycle.tolist()
    high = [fall - rise for rise, fall in zip(edges[::2], edges[1::2], strict=True)]
    assert high == [cycles + 1 for cycles in LENGTHS]
