"""Cycles and clocks: exact, rounded to the nearest with a half up, and the error said."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from servogen.units import Clock, Cycles, Rounded, counted


def test_a_cycle_is_four_oscillator_periods() -> None:
    # DS35007, section 2.2: 4 MHz gives 1 µs, 10 MHz 400 ns.
    assert Clock(4_000_000).cycle_us == 1
    assert Clock(10_000_000).cycle_us == Fraction(2, 5)
    assert Clock(4_000_000).cycles_per_second == 1_000_000


def test_times_are_exact_fractions() -> None:
    clock = Clock(3_579_545)
    assert clock.us(3_579_545) == 4_000_000
    assert clock.seconds(3_579_545) == 4


@pytest.mark.parametrize(
    ("us", "cycles"),
    [(1167, 2334), (Fraction(7000, 6), 2333), (0.25, 1), (0.2, 0), (0.75, 2), (-0.25, 0), (-0.75, -1)],
)
def test_rounding_is_to_the_nearest_cycle_and_a_half_goes_up(us: Fraction | float, cycles: int) -> None:
    assert Clock(8_000_000).round_us(us).cycles == cycles  # a cycle is half a microsecond


def test_what_was_asked_for_and_what_is_got_are_both_kept() -> None:
    rounded = Clock(4_000_000).round_us(Fraction(3500, 3))
    assert rounded == Rounded(Fraction(3500, 3), Cycles(1167), Fraction(1167))
    assert rounded.error_us == Fraction(1, 3)
    assert not rounded.exact
    assert Clock(4_000_000).round_us(1500).exact


@given(hz=st.integers(1, 10**8), us=st.fractions(-(10**9), 10**9))
def test_the_error_is_never_more_than_half_a_cycle(hz: int, us: Fraction) -> None:
    clock = Clock(hz)
    rounded = clock.round_us(us)
    assert -clock.cycle_us / 2 < rounded.error_us <= clock.cycle_us / 2
    assert rounded.achieved_us == clock.us(rounded.cycles)
    assert clock.round_seconds(us / 1_000_000) == rounded.cycles


@pytest.mark.parametrize("hz", [0, -4_000_000])
def test_a_clock_has_a_positive_frequency(hz: int) -> None:
    with pytest.raises(ValueError, match="positive frequency"):
        Clock(hz)


@pytest.mark.parametrize(
    ("number", "noun", "text"),
    [
        (0, "cycle", "0 cycles"),
        (1, "cycle", "1 cycle"),
        (2, "cycle", "2 cycles"),
        (3, "glitch", "3 glitches"),
    ],
)
def test_a_count_has_its_noun_in_the_singular_or_the_plural(number: int, noun: str, text: str) -> None:
    assert counted(number, noun) == text
