"""What the stream's interrupt guarantees for every line; changes that break it are noticed.

`tools/prove_streams.py` follows every cycle of a fall's round; here none or one of them is.
"""

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.engines.stream.engine import compiled, stream
from servogen.engines.stream.settings import BIT_GAP, START_GAP
from servogen.engines.stream.theorem import InterruptChanged, guarantee
from servogen.job import load, plan_job
from tests.engines.stream.stream_soak import JOBS

JOB = plan_job(load(JOBS / "stream-eight.toml"))
STREAMED = stream(JOB)[1]
FINES = (255,)
NONE = ()


@pytest.fixture(scope="module")
def text() -> str:
    return compiled(JOB, STREAMED, "c2c").text


def test_edges_are_exact_and_samples_as_close_as_the_receiver_is_reckoned_for(text: str) -> None:
    found = guarantee(listing_of(text), STREAMED, NONE)
    # RISE, and the cycles from the timer's value to the port: 11, as test_stream_tick.py counts them.
    assert found.rise == 152 + 11
    assert (found.start_gap, found.bit_gap) <= (START_GAP, BIT_GAP)


def listing_of(text: str):  # type: ignore[no-untyped-def]
    return compile_sources([Source(text, "main.c2c.c")], Options(device=JOB.device)).listing


@pytest.mark.parametrize(
    ("before", "after", "why"),
    [
        # TMR0 loses a cycle in each half of a round.
        ("movlw   131 ", "movlw   130 ", "ends with TMR0 127 cycles ahead"),
        # One of the paths of the last bits of the wait is a cycle longer.
        ("btfsc   _t, 0\n    goto    $+1", "btfsc   _t, 0\n    nop", "is in cycle"),
        # The look before an edge comes too late for a long one.
        ("addlw   72", "addlw   88", "does not end within"),
        # The fall is one interrupt early.
        ("sublw   16", "sublw   15", "after the rise of a pulse"),
        # A bit's time.
        ("movlw   104", "movlw   103", "the receiver's clock"),
        # A start bit moves a pin.
        ("movlw   10\n    movwf   _rx_bits", "movwf   PORTB\n    movwf   _rx_bits", "the receiver's clock"),
        ("bcf     INTCON, 2           ; T0IF", "clrf    PORTB", "writes a port"),
        # The width is not the one that the C prepared; a variable of the C is written.
        (
            "movf    _next_lo, W\n    movwf   _fine",
            "movf    _next_hi, W\n    movwf   _fine",
            "after the rise",
        ),
        ("movwf   _value", "movwf   _next_lo", "not the interrupt's"),
        # The pin is not the one that the C prepared.
        ("movf    _mask, W", "movf    _value, W", "does not write the pin"),
    ],
)
def test_a_changed_interrupt_is_noticed(text: str, before: str, after: str, why: str) -> None:
    changed = text.replace(before, after)
    assert changed != text
    with pytest.raises(InterruptChanged, match=why):
        guarantee(listing_of(changed), STREAMED, FINES)
