"""Proof for all time: the first repeat of the machine's complete state."""

from __future__ import annotations

import pytest

from servogen.edges import PINS
from servogen.simulator import NoRepeat, Repeat, find_repeat
from tests.simulator.helpers import CLOCK, image

RB0 = PINS.index("RB0")
SET_UP = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"
PULSE = " bsf PORTB, 0\n nop\n bcf PORTB, 0\n"


def search(source: str, limit: int = 1_000_000, period: int | None = None) -> Repeat | NoRepeat:
    return find_repeat(image(source), CLOCK, pin=RB0, limit=limit, period=period)


def test_a_plain_loop_repeats_from_its_first_frame() -> None:
    assert search(SET_UP + "loop\n" + PULSE + " goto loop\n") == Repeat(4, 5, 0, 1)


def test_a_lead_in_is_found_to_the_frame() -> None:
    """Seven pulses with a counter, then a loop of three pulses of different spacing."""
    source = SET_UP + " movlw 7\n movwf 0x20\nlead\n" + PULSE + " decfsz 0x20, f\n goto lead\n"
    source += "loop\n" + PULSE + PULSE + " nop\n" + PULSE + " goto loop\n"
    found = search(source)
    assert found == Repeat(lead_in=6 + 7 * 6 - 1, loop=12, lead_in_frames=7, loop_frames=3)


def test_given_periods_are_frame_starts_also_without_a_pulse() -> None:
    source = SET_UP + "loop\n" + PULSE + " nop\n" * 95 + " nop\n" * 98 + " goto loop\n"
    assert search(source, period=100) == Repeat(4, 198 * 50, 0, 99)
    source = SET_UP + "loop\n" + PULSE + " nop\n" * 97 + " nop\n" * 98 + " goto loop\n"
    assert search(source, period=100) == Repeat(4, 200, 0, 2)


def test_a_counter_makes_the_loop_as_long_as_it_is() -> None:
    source = SET_UP + " clrf 0x20\nloop\n" + PULSE + " incf 0x20, f\n goto loop\n"
    assert search(source) == Repeat(4 + 1, 256 * 6, 0, 256)


def test_the_timers_phase_counts() -> None:
    counting = " bsf STATUS, RP0\n movlw 0x88\n movwf OPTION_REG\n bcf STATUS, RP0\n"
    found = search(counting + SET_UP + "loop\n" + PULSE + " goto loop\n")
    assert isinstance(found, Repeat)
    assert found.loop == 5 * 256


def test_reading_ram_that_was_never_written_refuses_the_proof() -> None:
    loop = "loop\n" + PULSE + " incfsz 0x30, f\n goto loop\n goto loop\n"
    assert isinstance(search(SET_UP + " clrf 0x30\n" + loop), Repeat)
    found = search(SET_UP + loop)
    assert isinstance(found, NoRepeat)
    assert "0x30" in found.reason


def test_a_counter_out_of_reach_is_reported_with_the_time_covered() -> None:
    source = SET_UP + " clrf 0x20\n clrf 0x21\n clrf 0x22\nloop\n" + PULSE
    source += " incfsz 0x20, f\n goto loop\n incfsz 0x21, f\n goto loop\n incf 0x22, f\n goto loop\n"
    found = search(source, limit=20_000)
    assert isinstance(found, NoRepeat)
    assert found.reason == "no state was found that repeats"
    assert found.covered >= 20_000 - 10


@pytest.mark.parametrize(
    ("source", "reason"),
    [(" goto $\n", "RB0 never rises"), (SET_UP + PULSE + " goto $\n", "RB0 rises only once")],
)
def test_pins_that_rest_are_no_pulse_train(source: str, reason: str) -> None:
    found = search(source, limit=10_000)
    assert isinstance(found, NoRepeat)
    assert found.reason == reason


def test_the_last_frame_may_begin_at_the_limit() -> None:
    """The second one begins in cycle 9: with an edge, which that cycle has to make, or a period after 4."""
    source = SET_UP + "loop\n" + PULSE + " goto loop\n"
    for period, last in ((None, 10), (5, 9)):
        assert search(source, last, period) == Repeat(4, 5, 0, 1)
        found = search(source, last - 1, period)
        assert isinstance(found, NoRepeat) and found.reason == "RB0 rises only once"
