"""How long an analyser can look: the arithmetic of the SUMP protocol, worked by hand."""

from fractions import Fraction

import pytest

from servogen.bench.analysers.memory import CaptureNeeds, plan, words_of_frame
from servogen.errors import InputError

FRAME = Fraction(1, 50)


def test_without_rle_a_sample_is_a_word() -> None:
    assert words_of_frame(Fraction(1_000_000), False, FRAME, Fraction(2)) == 20_000


def test_with_rle_a_level_is_two_words_and_so_is_each_full_count() -> None:
    """200000 samples are 6.1 counts of 15 bits."""
    assert words_of_frame(Fraction(10_000_000), True, FRAME, Fraction(2)) == 4 + Fraction(400_000, 32_768)


def test_too_little_for_what_is_wanted_says_how_long_it_can_be() -> None:
    """(12288 - 9.2207) / 5.2207 = 2351.9"""
    with pytest.raises(InputError, match="hold 2351 frames") as error:
        plan(24 * 1024, 1_000_000, True, one_servo(5000))
    assert error.value.hint == (
        "at most --seconds 47.02 at a time; with --against, several captures are stitched"
    )


@pytest.mark.parametrize(
    ("rate", "hint"),
    [
        *((3_000_000, "try 2500000"), (6_000_000, "try 5000000"), (7_000_000, "try 6250000")),
        *((5, "try 8"), (0, "try 8"), (-8, "try 8"), (200_000_000, "try 100000000")),
    ],
)
def test_a_rate_that_the_analyser_does_not_have_is_refused_with_the_next_lower_one(
    rate: int, hint: str
) -> None:
    with pytest.raises(InputError) as error:
        plan(24 * 1024, rate, True, one_servo(1))
    assert error.value.message == (
        f"the analyser cannot take {rate} samples per second: it divides 100000000 by a whole number "
        "up to 16777216"
    )
    assert (error.value.code, error.value.hint) == ("bad-rate", hint)


def test_every_advised_rate_is_accepted() -> None:
    """The divisors of 100 MHz, which is 2^8·5^8, whose quotient less one has 24 bits."""
    divisors = sorted(2**twos * 5**fives for twos in range(9) for fives in range(9))
    usable = [rate for rate in divisors if 100_000_000 // rate - 1 < 1 << 24]
    assert (len(divisors), usable[0]) == (81, 8)
    for rate in usable:
        assert plan(1 << 19, rate, True, one_servo(1)).rate == rate
    asked = {near for rate in divisors for near in (rate - 1, rate, rate + 1)} | set(range(1, 300))
    for rate in sorted(asked - set(usable)):
        with pytest.raises(InputError) as error:
            plan(1 << 19, rate, True, one_servo(1))
        advised = max((lower for lower in usable if lower <= rate), default=8)
        assert error.value.hint == f"try {advised}"


def one_servo(frames: int) -> CaptureNeeds:
    return CaptureNeeds(FRAME, Fraction(2), frames, Fraction(2), 2)
