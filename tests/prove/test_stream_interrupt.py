"""What the stream's interrupt guarantees for every line; changes that break it are noticed.

`servogen prove --any-line` follows every cycle of a fall's round; here none or one of them is.
"""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.engines.stream.engine import stream
from servogen.engines.stream.firmware import compiled
from servogen.engines.stream.interrupt_code import HALF, ROUND
from servogen.engines.stream.settings import BIT_GAP, START_GAP
from servogen.job import load, loads, plan_job
from servogen.prove.stream.interrupt import min_bit_cycles, min_first_bit_cycles
from servogen.prove.stream.looks import InterruptChanged
from servogen.prove.stream.rounds import guarantee
from tests.campaigns import sampled
from tests.engines.stream.stream_soak import JOBS

JOB = plan_job(load(JOBS / "stream-eight.toml"))
STREAMED = stream(JOB)[1]
TWO_PORTS = (JOBS / "stream-arm.toml").read_text().replace('"RB2"', '"RA0"').replace("transmit_pin", "# ")
FINES = (255,)
NONE = ()


@pytest.fixture(scope="module")
def text() -> str:
    return compiled(JOB, STREAMED, "c2c").text


def test_edges_are_exact_and_samples_as_close_as_the_receiver_is_reckoned_for(text: str) -> None:
    found = guarantee(listing_of(text), STREAMED, NONE)
    # RISE, and the cycles from the timer's value to the port: 11, as test_stream_tick.py counts them.
    assert found.rise == 152 + 11
    assert found.samples.start_gap <= START_GAP
    # The looks of a round's two interrupts, and of the second and the next round's first, are half a round
    # apart; a loop that waits is left a cycle sooner or later.
    for half in (range(HALF), range(HALF, ROUND)):
        waits = {wait for before, wait in found.samples.waits if before in half}
        assert min(waits) > 0 and max(waits) == BIT_GAP == HALF + 1


def test_no_bit_is_taken_before_it_can_be_due() -> None:
    """Times are known modulo 64 units of 4 cycles; a bit is 104 of them, the first one is due after 15."""
    assert (min_bit_cycles(STREAMED), min_first_bit_cycles(STREAMED)) == (4 * (104 - 64), 4 * 15 + 1)


def test_an_interrupt_begins_up_to_15_cycles_after_its_overflow(text: str) -> None:
    """4 of latency and 2 of an instruction (DS35007 section 6.9), 9 in which the C writes the EEPROM."""
    first = "    bcf     INTCON, 2           ; T0IF"
    latest = 15 + 4 + 1  # the context is saved in 4, and TMR0 is read in the second word after it
    guarantee(listing_of(text.replace(first, fails_from(latest + 1) + first)), STREAMED, NONE)
    with pytest.raises(InterruptChanged, match="an instruction that is not followed"):
        guarantee(listing_of(text.replace(first, fails_from(latest) + first)), STREAMED, NONE)


def cycles(thirds: int) -> str:
    """Words that take three cycles for each."""
    return f"    movlw   {thirds}\n    movwf   _t\n    decfsz  _t, F\n    goto    $-1\n"


def fails_from(time: int) -> str:
    """Words that are refused where they can be executed with this time in TMR0, or a later one."""
    return f"    movlw   {256 - time}\n    addwf   TMR0, W\n    btfsc   STATUS, 0\n    clrf    TMR0\n"


RARELY = "    movlw   0x37\n    xorwf   _value, W\n    btfsc   STATUS, 2\n"
"""Words that skip the next one, but for one content of a byte of the C."""
LOST = "    decf    _ticks, W\n    btfsc   STATUS, 2\n    clrf    _ticks\n"
"""Words that lose the last interrupt before an edge, and do nothing to other counts."""

AFTER = {
    "rise": ("bsf     _due, 2\n", "bsf     _due, 2\n{late}"),
    "fall before the last round but one": ("st_over:\n", "st_over:\n"),
    "fall in the last round but one": (
        "btfsc   STATUS, 2\n    goto    st_out\nst_over:\n",
        "btfss   STATUS, 2\n    goto    st_over\n{late}    goto    st_out\nst_over:\n",
    ),
    "fall that takes over the next round": (
        "call    st_look\n    goto    st_whole_round",
        "nop\n{late}    goto    st_out",
    ),
}
"""Where the interrupt of an edge ends; for `late`, words that take long."""
BEGINS = {
    "no edge": ("st_plain_quiet:\n", "st_plain_quiet:\n" + fails_from(48)),
    "a rise": ("clrf    _fine ", fails_from(96) + "    clrf    _fine "),
    "a fall": (
        "goto    st_fall\n    clrf    _fine",
        f"goto    $+2\n    goto    $+6\n{fails_from(96)}    goto    st_fall\n    clrf    _fine",
    ),
}
"""Where an interrupt goes that begins a round with this; it fails if that began late."""


@cache
def not_late(text: str, following: str) -> str:
    """The C that fails if an interrupt that begins a round with this is late, as none is."""
    failing = text.replace(*BEGINS[following])
    guarantee(listing_of(failing), STREAMED, NONE)
    return failing


@pytest.mark.parametrize(
    ("edge", "late", "following", "fine"),
    sampled(
        [
            ("rise", 27, "no edge", 255),
            ("rise", 27, "a fall", 255),
            ("fall before the last round but one", 0, "no edge", 70),
            ("fall in the last round but one", 20, "a rise", 70),
            ("fall that takes over the next round", 27, "no edge", 255),
            ("fall that takes over the next round", 45, "a rise", 255),
        ],
    ),
)
def test_what_the_round_behind_an_edge_may_be_is_tried(
    text: str, edge: str, late: int, following: str, fine: int
) -> None:
    """An interrupt begins late, because that of an edge ends late, and fails if its round has `following`."""
    failing = not_late(text, following)
    before, after = AFTER[edge]
    changed = failing.replace(before, after.format(late=cycles(late)))
    with pytest.raises(InterruptChanged, match="an instruction that is not followed"):
        guarantee(listing_of(changed), STREAMED, (fine,))


def test_a_fall_late_in_the_last_round_but_one_keeps_samples_away_but_not_out_of_their_bits(
    text: str,
) -> None:
    # The next slot's interrupt comes so soon after a fall in cycle 64 that there is no sample between.
    found = guarantee(listing_of(text), STREAMED, (64,))
    assert START_GAP < found.samples.start_gap <= START_GAP + 9
    bit = STREAMED.plan.schedule.clock.cycles_per_second / STREAMED.stream.baud
    for k in range(10):
        latest = found.samples.latest(k, STREAMED.first_units, STREAMED.bit_units)
        earliest = found.samples.earliest(k, STREAMED.first_units, STREAMED.bit_units)
        assert k * bit / Fraction(98, 100) <= earliest < latest <= (k + 1) * bit / Fraction(102, 100)
    # With twice the gaps the stop bit would be over.
    samples = found.samples
    far = replace(samples, starts=frozenset(start._replace(gap=2 * start.gap) for start in samples.starts))
    assert far.latest(9, STREAMED.first_units, STREAMED.bit_units) > 10 * bit / Fraction(102, 100)


@pytest.mark.campaign
def test_servos_on_two_ports_have_the_same_edges_a_pointer_later() -> None:
    job = plan_job(loads(TWO_PORTS, "job.toml"))
    found = guarantee(listing_of(compiled(job, streamed := stream(job)[1], "c2c").text), streamed, FINES)
    assert found.rise == 152 + 11
    assert found.samples.start_gap <= START_GAP + 9


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("movf    _port, W\n", "movf    _next_port, W\n"),  # the fall is on the next pulse's port
        ("movwf   _port\n", "nop\n"),  # that of the first pulse is all others', too
        ("movf    _port, W\n    movwf   FSR", "movf    _port, W\n    nop"),
    ],
)
def test_an_edge_on_the_other_port_is_noticed(before: str, after: str) -> None:
    job = plan_job(loads(TWO_PORTS, "job.toml"))
    changed = compiled(job, streamed := stream(job)[1], "c2c").text.replace(before, after)
    with pytest.raises(InterruptChanged, match="not written to the port of its pulse"):
        guarantee(listing_of(changed), streamed, FINES)


def test_a_program_without_a_word_of_its_interrupt_is_refused(text: str) -> None:
    listing = listing_of(text)
    gone = listing.label("st_exactly")
    rows = tuple(row for row in listing.rows if row.address != gone)
    with pytest.raises(InterruptChanged, match=f"^the interrupt leaves its words at 0x{gone:03X}$"):
        guarantee(replace(listing, rows=rows), STREAMED, NONE)


def listing_of(text: str):  # type: ignore[no-untyped-def]
    return compile_sources([Source(text, "main.c2c.c")], Options(device=JOB.device)).listing


@pytest.mark.parametrize(
    ("before", "after", "why"),
    sampled(
        [
            # TMR0 loses a cycle in each half of a round.
            ("movlw   131 ", "movlw   130 ", "ends with TMR0 127 cycles ahead"),
            # One of the paths of the last bits of the wait is a cycle longer.
            ("btfsc   _t, 0\n    goto    $+1", "btfsc   _t, 0\n    nop", "is in cycle"),
            # The look before an edge comes too late for a long one.
            ("addlw   72", "addlw   88", "does not end within"),
            # The fall is one interrupt early.
            ("sublw   16", "sublw   15", "after the rise of a pulse"),
            # The fall of a pulse of one round, and of no other, is an interrupt late.
            (
                "movwf   _ticks\n    sublw   16",
                "movwf   _ticks\n    decf    _next_hi, W\n    btfsc   STATUS, 2\n    incf    _ticks, F\n"
                "    movf    _ticks, W\n    sublw   16",
                "^after the rise of a pulse of 1 round",
            ),
            # That of the widest pulse, and of no other, is an interrupt late.
            (
                "movwf   _ticks\n    sublw   16",
                "movwf   _ticks\n    movf    _next_hi, W\n    xorlw   8\n    btfsc   STATUS, 2\n"
                "    incf    _ticks, F\n    movf    _ticks, W\n    sublw   16",
                "^after the rise of a pulse of 8 rounds",
            ),
            # A round's second interrupt ends too late for a rise in the next round.
            (
                "st_out:\n",
                f"    btfss   _ticks, 0\n    goto    st_out\n{cycles(30)}st_out:\n",
                "a rise is in cycle",
            ),
            # A bit's time.
            ("movlw   104", "movlw   103", "the receiver's clock"),
            # A bit is sampled too late.
            ("st_data:\n", "st_data:\n" + "    nop\n" * 5, "a bit is sampled 3"),
            # A start bit moves a pin.
            ("movlw   10\n    movwf   _rx_bits", "movwf   PORTB\n    movwf   _rx_bits", "not its own"),
            ("bcf     INTCON, 2           ; T0IF", "clrf    PORTB", "writes a port"),
            # The width is not the one that the C prepared; a variable of the C is written.
            (
                "movf    _next_lo, W\n    movwf   _fine",
                "movf    _next_hi, W\n    movwf   _fine",
                "after the rise",
            ),
            ("movwf   _value", "movwf   _next_lo", "writes what is not its own"),
            # There is no wait for the cycle of an edge.
            ("call    st_exactly", "nop", "the interrupt's parts are not there"),
            # Pins are written beside the edges, one of them the pin that answers.
            (
                "bcf     INTCON, 2           ; T0IF",
                "bcf     INTCON, 2\n    bsf     PORTA, 2\n    bsf     PORTA, 3",
                "^the word at 0x009 writes a port$",
            ),
            ("st_plain:\n", "st_plain:\n    bsf     PORTB, 0\n    bcf     PORTB, 0\n", "writes a port"),
            (
                "st_sync:\n",
                "st_sync:\n    movf    PORTB, W\n    clrf    PORTB\n    movwf   PORTB\n",
                "its own",
            ),
            # A look at the line moves the time, or lets interrupts nest; a bit of the line is forgotten.
            ("st_sync:\n", "st_sync:\n    movlw   10\n    addwf   TMR0, F\n", "its own"),
            ("    movwf   _command\n    return", "    movwf   _command\n    retfie", "ends the interrupt"),
            ("st_plain:\n", "st_plain:\n    clrf    _todo\n", "not the interrupt's"),
            # Beside a rise a pulse is asked for.
            ("st_plain:\n", "st_plain:\n    bsf     _due, 1\n", "beside a rise"),
            # No rise writes the pin.
            (
                "btfsc   STATUS, 2\n    movf    _mask, W",
                "goto    $+2\n    movf    _mask, W",
                "jumps to an edge",
            ),
            # A pulse is left out: always, or with one content of a byte. One that is prepared is cleared.
            (
                "goto    st_fall\n    clrf    _mask",
                "goto    st_past\n    clrf    _mask",
                "not the interrupt's",
            ),
            ("    clrf    _fine  ", f"{RARELY}    goto    st_past\n    clrf    _fine  ", "not on every path"),
            ("goto    st_fall\n    clrf    _mask", "nop\n    clrf    _mask", "not the interrupt's"),
            ("st_plain:\n", f"st_plain:\n{RARELY}    goto    st_no_pulse\n", "jumps to an edge"),
            # Between two edges, the next one is made a rise, or moved.
            ("st_late:\n", "st_late:\n    clrf    _rest\n", "moves an edge"),
            ("st_plain:\n", "st_plain:\n    incf    _fine, F\n", "moves an edge"),
            # A flag is cleared that may not be set yet, or is that of another overflow.
            (
                "btfss   _fine, 7\n    goto    st_early",
                "btfss   _fine, 6\n    goto    st_early",
                "T0IF is cleared",
            ),
            ("goto    st_out              ; found", "bcf     INTCON, 2", "T0IF is cleared"),
            # The oscillator stops; pins are turned round; the rest of the interrupt is executed in bank 1.
            ("bcf     INTCON, 2           ; T0IF", "sleep", "SLEEP at 0x008 is not followed"),
            ("bcf     INTCON, 2           ; T0IF", "tris    PORTB", "TRIS at 0x008 is not followed"),
            (
                "bcf     INTCON, 2           ; T0IF",
                "movlw   0x20\n    movwf   STATUS",
                "the word at 0x009 writes what is not the interrupt's",
            ),
            # What is done depends on how many interrupts are left until the edge, not only on the last.
            ("st_plain:\n", "st_plain:\n    btfsc   _ticks, 4\n    nop\n", "depends on how many"),
            ("st_plain:\n", "st_plain:\n    movf    _ticks, W\n    movwf   _t\n", "depends on how many"),
            # The last but one of an undivided round becomes none; the number that stands for it is larger.
            (
                "st_late:\n    decf    _ticks, F\n",
                f"st_late:\n    decf    _ticks, F\n{LOST}",
                "depends on how many",
            ),
            ("st_over:\n", "st_over:\n    btfss   _ticks, 1\n    nop\n", "depends on how many"),
            ("clrf    _rest\n", "btfss   _rest, 3\n    clrf    _rest\n", "depends on how many"),
            (
                "decf    _ticks, W\n    btfsc   STATUS, 2",
                "decf    _ticks, W\n    movwf   _ticks",
                "a fall: it ends",
            ),
            # The timer is read while it stands still, set to run over, or written otherwise than by adding.
            (
                "movlw   131\n    addwf   TMR0, F",
                "movlw   131\n    addwf   TMR0, F\n    nop\n    nop\n    movf    TMR0, W",
                "read while it does not count",
            ),
            ("movlw   131 ", "movlw   255 ", "overflows because it is written"),
            ("st_late:\n", "st_late:\n    clrf    TMR0\n", "written by an instruction that is not followed"),
            (
                "st_late:\n",
                "st_late:\n    decfsz  TMR0, W\n",
                "written by an instruction that is not followed",
            ),
            # Of the registers and of the C's variables only some bits are the interrupt's.
            ("st_plain:\n", "st_plain:\n    bcf     INTCON, 5\n", "not the interrupt's"),
            ("st_plain:\n", "st_plain:\n    bsf     STATUS, 5\n", "not the interrupt's"),
            ("st_plain:\n", "st_plain:\n    bcf     _due, 1\n", "not the interrupt's"),
            ("st_plain:\n", "st_plain:\n    movwf   _rx_left\n", "not the interrupt's"),
            ("st_plain:\n", "st_plain:\n    xorwf   STATUS, F\n", "not the interrupt's"),
            ("btfss   _due, 1\n    goto    st_fall", "nop\n    goto    $+1", "not the interrupt's"),
            ("st_sync:\n", "st_sync:\n    bsf     STATUS, 5\n", "its own"),
            ("st_sync:\n", "st_sync:\n    clrf    _ticks\n", "its own"),
            # A fall leaves the port as it is, or another byte than a port is written.
            (
                "movlw   0\n    btfsc   STATUS, 2",
                "movlw   1\n    btfsc   STATUS, 2",
                "does not write the pin",
            ),
            ("movwf   PORTB               ; the edge", "movwf   _mask", "not written to a port"),
            # The pin is not the one that the C prepared.
            ("movf    _mask, W", "movf    _value, W", "does not write the pin"),
        ],
        8,
    ),
)
def test_a_changed_interrupt_is_noticed(text: str, before: str, after: str, why: str) -> None:
    changed = text.replace(before, after)
    assert changed != text
    labels = {
        "; the edge\n": "; the edge\nst_past:\n",
        "    clrf    _mask": "st_no_pulse:\n    clrf    _mask",
    }
    for words, labelled in labels.items():
        changed = changed.replace(words, labelled)
    listing = listing_of(changed)
    with pytest.raises(InterruptChanged, match=why):
        guarantee(listing, STREAMED, NONE)  # which most changes fail, and which takes a third of the time
        guarantee(listing, STREAMED, (70, *FINES))
