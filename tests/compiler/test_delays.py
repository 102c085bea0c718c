"""A delay takes exactly the cycles that it says, whatever its length, unit and clock."""

from __future__ import annotations

from itertools import pairwise

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.edges import PINS
from servogen.simulator import Machine
from servogen.units import Clock
from tests.campaigns import sampled

WRITE = 1
"""Cycles of the BSF or BCF that ends a delay."""


def measured(delays: list[str], dialect: str, clock: int, total: int) -> list[int]:
    """The cycles between changes of RB0 with one of the delays before each."""
    body = "".join(
        f"{delay}; {'RB0 = 0' if number % 2 else 'RB0 = 1'};\n" for number, delay in enumerate(delays)
    )
    text = f"unsigned char n;\nvoid main(void) {{ TRISB = 0; RB0 = 1; RB0 = 0;\n{body} }}\n"
    found = compile_sources([Source(text, "delays.c")], Options(dialect=dialect, clock_hz=clock))
    assert found.clock is not None
    edges = Machine(found.image, found.clock).run(total + 3000)
    times = [int(cycle) for cycle, pin in zip(edges.cycle, edges.pin, strict=True) if PINS[pin] == "RB0"]
    return [after - before - WRITE for before, after in pairwise(times[2:])]


def check(counts: list[int], delays: list[str], dialect: str, clock: int) -> None:
    assert measured(delays, dialect, clock, sum(counts) + 2 * len(counts)) == counts


@pytest.mark.parametrize("start", sampled(range(0, 1200, 60), 7))
def test_every_short_count_of_cycles(start: int) -> None:
    counts = list(range(start, start + 60))
    check(counts, [f"_delay({count})" for count in counts], "xc8", 4_000_000)


@pytest.mark.parametrize(
    "counts",
    [
        [1023, 1024, 1025, 1026, 1027, 4095, 65535, 65536, 65537, 99_999],
        [197_119, 197_120, 197_121, 197_122, 197_123, 262_657, 262_658, 262_659, 263_680],
        [1_000_003, 5_000_000, 50_463_237, 50_463_240],
    ],
)
def test_counts_around_the_ends_of_the_loops_ranges(counts: list[int]) -> None:
    check(counts, [f"_delay({count})" for count in counts], "xc8", 4_000_000)


@pytest.mark.parametrize("turns", [1, 2, 15, 254, 255, 256])
def test_delays_of_the_same_outer_counter(turns: int) -> None:
    """One routine sets the counter for all of them, or a routine for each length that occurs often does."""
    first = 8 + 1026 * (turns - 1)
    counts = [first + step for step in range(0, 1024, 37)] + [first + 500, first + 501] * 4
    check(counts, [f"_delay({count})" for count in counts], "xc8", 4_000_000)


def compiled(delays: list[int]) -> Compilation:
    """A program whose function `f` has these delays, each followed by a BSF."""
    statements = "".join(f"_delay({count}); RB0 = 1;\n" for count in delays)
    text = f"void f(void) {{ {statements} }}\nvoid main(void) {{ TRISB = 0; f(); while (1); }}"
    return compile_sources([Source(text, "delays.c")], Options(dialect="xc8", clock_hz=4_000_000))


def test_many_delays_between_one_and_two_milliseconds_take_two_words_each() -> None:
    """MOVLW and CALL, and the BSF behind it; where a length occurs often, only the CALL."""
    widths = list(range(1100, 1900, 41))
    assert compiled([*widths, 1901, 1945, 1989]).words - compiled(widths).words == 3 * 3
    assert compiled([*widths, *[1500] * 9]).words - compiled([*widths, *[1500] * 8]).words == 2


def test_routines_that_jump_into_a_shared_loop_take_one_stack_level_together() -> None:
    """f calls that of 1500 cycles; it jumps to the one that sets the counter, and that to the loop."""
    functions = {
        each.name: each for each in compiled([*range(1100, 1900, 41), *[1500] * 8]).listing.functions
    }
    for name, levels in {"f": 1, "__delay_1500": 0, "__delay_turns2": 0}.items():
        assert functions[name].deepest_calls == levels


def test_delays_in_the_interrupt_have_loops_of_their_own() -> None:
    """An interrupt in the middle of a delay of main must not change its counter."""
    delays = [f"_delay({count});" for count in range(1100, 1400, 40)]
    text = f"""
#include <xc.h>
void __interrupt() isr(void) {{ {" RB1 = 1; RB1 = 0; ".join(delays)} INTF = 0; }}
void main(void) {{ TRISB = 1; INTE = 1; GIE = 1; while (1) {{ {" RB2 = 1; RB2 = 0; ".join(delays)} }} }}
"""
    found = compile_sources([Source(text, "delays.c")], Options(dialect="xc8", clock_hz=4_000_000))
    names = {each.name for each in found.listing.functions if each.name.startswith("__delay")}
    of_main = {name for name in names if "$isr" not in name}
    assert names - of_main == {f"{name}$isr" for name in of_main}
    assert any(name.startswith("__delay_turns") for name in of_main)
    assert len({each.start for each in found.listing.functions if each.name in names}) == len(names)


UNITS = {"delay_us": 1, "delay_10us": 10, "delay_ms": 1000, "delay_s": 1_000_000}


@pytest.mark.parametrize("clock", [4_000_000, 8_000_000, 20_000_000])
@pytest.mark.parametrize("function", ["delay_us", "delay_10us", "delay_ms"])
def test_the_arguments_of_the_units(function: str, clock: int) -> None:
    arguments = sorted({*range(5), *range(0, 256, 5), *range(252, 256)})
    counts = [argument * UNITS[function] * clock // 4_000_000 for argument in arguments]
    check(counts, [f"{function}({argument})" for argument in arguments], "c2c", clock)


@pytest.mark.parametrize("argument", [1, 2, 255])
def test_seconds(argument: int) -> None:
    check([argument * 1_000_000], [f"delay_s({argument})"], "c2c", 4_000_000)


LEAST = {1: 22, 2: 10, 3: 4, 4: 3, 5: 3, 10: 2, 20: 1, 1000: 1}
"""docs/compiler.md: the least argument that is exact, by cycles a unit."""


@pytest.mark.parametrize(
    ("function", "clock"),
    [("delay_us", hz) for hz in (4_000_000, 8_000_000, 12_000_000, 16_000_000, 20_000_000)]
    + [("delay_10us", 4_000_000), ("delay_10us", 8_000_000), ("delay_ms", 4_000_000)],
)
def test_a_variable_argument_is_exact_from_its_least_value_on(function: str, clock: int) -> None:
    unit = UNITS[function] * clock // 4_000_000
    arguments = [
        each for each in (LEAST[unit], LEAST[unit] + 1, 25, 100, 254, 255) if unit < 1000 or each < 30
    ]
    # the assignment of n is two cycles: MOVLW and MOVWF
    counts = [argument * unit + 2 for argument in arguments]
    check(counts, [f"n = {argument}; {function}(n)" for argument in arguments], "c2c", clock)


def test_a_variable_argument_of_zero_returns_at_once() -> None:
    assert measured(["n = 0; delay_us(n)"] * 2, "c2c", 4_000_000, 200)[0] == 7 + 1  # CLRF and the way through
    assert measured(["n = 0; delay_ms(n)"] * 2, "c2c", 4_000_000, 200)[0] == 7 + 1


def test_a_pulse_keeps_its_width_when_two_branches_end_alike() -> None:
    """The last statement of both branches is the same instruction; it stays behind its delay."""
    body = "if (x) { RB0 = 1; __delay_us(100); RB0 = 0; } else { RB0 = 1; __delay_us(50); RB0 = 0; } x++;"
    text = f"unsigned char x;\nvoid main(void) {{ TRISB = 0; while (1) {{ {body} }} }}"
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8", clock_hz=4_000_000))
    edges = Machine(found.image, Clock(4_000_000)).run(1000)
    times = [int(t) for t, p in zip(edges.cycle, edges.pin, strict=True) if PINS[p] == "RB0"]
    assert [two - one for one, two in pairwise(times[1:])][:5:2] == [51, 101, 101]
