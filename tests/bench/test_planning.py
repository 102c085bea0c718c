"""How long an analyser can look: the arithmetic of the SUMP protocol, worked by hand."""

from fractions import Fraction

import pytest

from servogen.bench.planning import Wanted, plan, words_a_frame
from servogen.errors import InputError

FRAME = Fraction(1, 50)


def test_without_rle_a_sample_is_a_word() -> None:
    assert words_a_frame(Fraction(1_000_000), False, Wanted(FRAME, 2, 1)) == 20_000


def test_with_rle_a_level_is_a_value_and_a_count() -> None:
    assert words_a_frame(Fraction(1_000_000), True, Wanted(FRAME, 2, 1)) == 4


def test_a_count_has_15_bits_and_what_is_longer_takes_two_words_more() -> None:
    """200000 samples hold six whole counts of 32768."""
    assert words_a_frame(Fraction(10_000_000), True, Wanted(FRAME, 2, 1)) == 4 + 12


def test_a_look_has_the_wanted_frames_and_the_one_it_begins_in() -> None:
    """24 KiB are 12288 words; 101 frames of 4 words and 4 to spare are 408."""
    planned = plan(24 * 1024, 1_000_000, True, Wanted(FRAME, 2, 100))
    assert (planned.words, planned.frames, planned.seconds) == (408, 100, 101 * FRAME)


def test_too_little_for_one_frame_is_refused_with_the_arithmetic() -> None:
    with pytest.raises(InputError, match=r"12288 words, and a frame of 20 ms at 1000000 .* 20000 samples"):
        plan(24 * 1024, 1_000_000, False, Wanted(FRAME, 2, 1))


def test_too_little_for_what_is_wanted_says_how_long_it_can_be() -> None:
    with pytest.raises(InputError, match="hold 3070 frames") as error:
        plan(24 * 1024, 1_000_000, True, Wanted(FRAME, 2, 5000))
    assert error.value.hint == "at most --seconds 61.4 at a time"


def test_a_rate_that_does_not_divide_100_mhz_is_refused() -> None:
    with pytest.raises(InputError, match="do not divide") as error:
        plan(24 * 1024, 3_000_000, True, Wanted(FRAME, 2, 1))
    assert error.value.hint == "as 2941176"
