"""Looks at a stream's line: every outcome with its times, and the words that keep the receiver's clock."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import pytest

from servogen.engines.stream.engine import stream
from servogen.engines.stream.interrupt_code import InterruptCode
from servogen.job import load, plan_job
from servogen.pic.isa import encode
from servogen.prove.stream import looks
from servogen.prove.stream.interrupt import Beginning, Interrupt
from servogen.prove.stream.looks import (
    BIT,
    HUNT,
    RECEIVER_VARIABLES,
    SENT,
    START,
    WAIT,
    InterruptChanged,
    Kind,
    Look,
    check_receiver,
    check_sample_times,
    look_outcomes,
)
from servogen.prove.stream.samples import LastLook, LookSequence, SeenStart, StampGap
from tests.engines.stream.stream_soak import JOBS

STREAMED = stream(plan_job(load(JOBS / "stream-eight.toml")))[1]
TMR0, STATUS, PORTA, PORTB = 1, 3, 5, 6
NAMES = ("ticks", "rest", "fine", "due", "mask", "port", "next_hi", "next_lo", *RECEIVER_VARIABLES)
RAM = {name: 0x20 + n for n, name in enumerate(NAMES)}
NOP = encode("NOP")


def round_of(*words: int, at: int = 0x60) -> InterruptCode:
    return InterruptCode(dict(enumerate(words, at)), RAM, 0x60, 0x70)


def receiver() -> dict[int, int]:
    t, left, last, bits = (RAM[name] for name in ("t", "rx_left", "rx_last", "rx_bits"))
    time = [
        encode("MOVF", f=TMR0, d=0),
        encode("BTFSS", f=RAM["ticks"], b=0),
        encode("ADDLW", k=128),
        encode("MOVWF", f=t),
        encode("RRF", f=t, d=1),
    ]
    take = [
        *time,
        encode("RRF", f=t, d=1),
        encode("BTFSC", f=bits, b=7),
        encode("GOTO", k=0x99),
        encode("MOVF", f=last, d=0),
        encode("SUBWF", f=t, d=0),
        encode("ANDLW", k=0x3F),
        encode("SUBWF", f=left, d=1),
        encode("MOVF", f=t, d=0),
        encode("MOVWF", f=last),
        encode("BTFSC", f=STATUS, b=0),
        encode("RETURN"),
        encode("MOVLW", k=104),
        encode("ADDWF", f=left, d=1),
    ]
    hunt = [
        encode("BTFSC", f=PORTA, b=4),
        encode("RETURN"),
        *time,
        encode("RRF", f=t, d=0),
        encode("MOVWF", f=last),
        encode("MOVLW", k=15),
        encode("MOVWF", f=left),
        encode("MOVLW", k=10),
        encode("MOVWF", f=bits),
        encode("RETURN"),
    ]
    return dict(enumerate(take, 0x60)) | dict(enumerate(hunt, 0x80))


def check(words: dict[int, int], streamed=STREAMED) -> None:  # type: ignore[no-untyped-def]
    check_receiver(words, RAM, 0x60, 0x80, streamed)


def test_each_word_that_keeps_the_receiver_s_time_is_the_one_that_is_expected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Times are 64 units of 4 cycles: the timer, half a round ahead while `ticks` is even, shifted twice."""
    check(receiver())
    assert (STREAMED.bit_units, STREAMED.first_units) == (104, 15)
    for other in (replace(STREAMED, bit_units=105), replace(STREAMED, first_units=16)):
        with pytest.raises(InterruptChanged, match="the receiver's clock is not kept"):
            check(receiver(), other)
    tick = looks.assemble  # the template is the same for every word: it is assembled once
    monkeypatch.setattr(looks, "assemble", cache(lambda text, file: tick(text, file)))
    for at in receiver():
        words = receiver() | {at: NOP}
        if at == 0x67:  # where a broken byte goes on
            check(words)
            continue
        clock = f"the receiver's clock is not kept by the word at 0x{at:03X}"
        with pytest.raises(InterruptChanged) as error:
            check(words)
        assert str(error.value) == ("a start bit is not looked for at a pin" if at == 0x80 else clock)
    for sample in (encode("BTFSS", f=PORTA, b=4), encode("BTFSC", f=7, b=4)):
        with pytest.raises(InterruptChanged, match=r"^a start bit is not looked for at a pin$"):
            check(receiver() | {0x80: sample})
    check(receiver() | {0x80: encode("BTFSC", f=PORTB, b=0)})


def test_a_bit_is_sampled_20_to_30_cycles_after_its_time_and_the_stop_bit_by_22() -> None:
    def found(code: InterruptCode) -> str:
        try:
            check_sample_times(code, 0x60)
        except InterruptChanged as error:
            return str(error)
        return ""

    def straight(count: int) -> InterruptCode:
        words = (
            encode("MOVF", f=TMR0, d=0),
            encode("ADDWF", f=RAM["rx_left"], d=1),
            *[NOP] * (count - 2),
            encode("BTFSC", f=PORTA, b=4),
            NOP,
            encode("RETURN"),
        )
        return round_of(*words)

    for cycles, right in ((19, False), (20, True), (22, True), (23, False)):
        text = f"a bit is sampled {cycles} cycles after its time stamp, at 0x{0x60 + cycles:03X}"
        assert found(straight(cycles)) == ("" if right else text)

    # Bits other than the stop bit, before which rx_bits is 1, have until 30.
    def unless_stop(count: int) -> InterruptCode:
        words = (
            encode("MOVF", f=TMR0, d=0),
            encode("ADDWF", f=RAM["rx_left"], d=1),
            encode("DECF", f=RAM["rx_bits"], d=1),
            encode("BTFSC", f=STATUS, b=2),
            encode("RETURN"),
            *[NOP] * (count - 5),
            encode("BTFSC", f=PORTA, b=4),
            NOP,
            encode("RETURN"),
        )
        return round_of(*words)

    for cycles, right in ((19, False), (20, True), (30, True), (31, False)):
        assert (found(unless_stop(cycles)) == "") == right, cycles


def test_every_outcome_of_a_look_has_its_times() -> None:
    words = dict(receiver())
    code = InterruptCode(words, RAM, 0x60, 0x70)
    hunting = look_outcomes(code, 0x80, 0x80)
    # None there: the sample skips nothing (1) and RETURN (2). A start: 2, and the time is read in cycle 2.
    assert Look(HUNT, 3, 0, 0) in hunting
    (start,) = (look for look in hunting if look.kind == START)
    # The skip over RETURN two cycles, eleven words one each (a skip over ADDLW as long as it), RETURN two.
    assert (start.sample, start.stamp, start.cycles) == (0, 2, 2 + 11 + 2)
    assert {look.kind for look in hunting} == {HUNT, START}
    taking = dict(words) | {0x67: encode("RETURN"), 0x72: encode("RETURN")}
    looks = look_outcomes(InterruptCode(taking, RAM, 0x60, 0x99), 0x60, 0x80)
    kinds = {look.kind for look in looks}
    assert kinds == {WAIT, BIT}
    assert all((look.stamp, look.sample) == (0, 20) for look in looks)
    # The time takes six cycles. A broken byte: BTFSC and RETURN; else the skip and six words, then the test
    # of the carry and RETURN, or the skip, two words and RETURN.
    assert {look.cycles for look in looks if look.kind == WAIT} == {6 + 1 + 2, 6 + 2 + 6 + 1 + 2}
    assert {look.cycles for look in looks if look.kind == BIT} == {6 + 2 + 6 + 2 + 2 + 2}


def test_a_look_that_stands_still_has_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(looks, "MAX_STATES", 50)
    with pytest.raises(InterruptChanged, match=r"^a look at the line does not end$"):
        look_outcomes(round_of(encode("GOTO", k=0x60)), 0x60, 0x80)


# looks that follow each other

INTERRUPT_RAM = {name: 0x20 + n for n, name in enumerate(("ticks", "rest", "fine", "t", "rx_bits"))}
BEFORE, SAMPLE, STAMP = -300, 10, 30
"""The cycles of the look before the interrupt, and of the one in it."""


def looked(
    last: Kind,
    look: Kind,
    *,
    answers: bool = False,
    before: int = BEFORE,
    receiving: int | None = None,
    others: tuple[int, ...] = (),
) -> tuple[set[str], set[SeenStart], set[StampGap]]:
    """An interrupt that looks once, after another look: the kinds of its last look, and the gaps noted."""
    code = InterruptCode({4: encode("CALL", k=0x60), 5: encode("RETFIE")}, INTERRUPT_RAM, 0x60, 0x70)
    # It begins in cycle 2, and the subroutine in cycle 4.
    outcomes = {0x60: (Look(look, 40, SAMPLE - 4, STAMP - 4),)}
    sequence = LookSequence(answers, min_first_bit_cycles=61)
    variables = {"ticks": 101} | ({} if receiving is None else {"rx_bits": receiving})
    begins = [Beginning(2, LastLook(last, sample, sample + 5)) for sample in (before, *others)]
    ends, _ = Interrupt(code, outcomes, 160, sequence).run(begins, variables)
    return {end.last.kind for end in ends}, sequence.starts, sequence.waits


@pytest.mark.parametrize(
    ("last", "kinds"),
    [
        # After a start bit a wait, or the first bit once it is due. A byte begins after a bit or none.
        (START, {WAIT, BIT}),
        (HUNT, {HUNT, START}),
        (BIT, {HUNT, START, WAIT, BIT}),
        (WAIT, {HUNT, START, WAIT, BIT}),
        # While the chip sends no start bit comes.
        (SENT, {WAIT, BIT}),
    ],
)
def test_looks_follow_each_other_as_a_receiver_can(last: Kind, kinds: set[Kind]) -> None:
    assert {kind for kind in (HUNT, START, WAIT, BIT) if looked(last, kind)[0]} == kinds


def test_a_bit_is_sent_though_none_was_received_if_the_chip_answers() -> None:
    assert looked(HUNT, BIT, answers=True)[0] == {SENT} and looked(HUNT, WAIT, answers=True)[0] == {WAIT}
    assert looked(BIT, BIT, answers=True)[0] == {BIT}


def test_a_bit_comes_when_its_time_is_over() -> None:
    """61 cycles after a start bit's time stamp, 160 after a bit's."""
    assert looked(START, BIT, before=STAMP - 5 - 61)[0] and not looked(START, BIT, before=STAMP - 5 - 60)[0]
    assert looked(BIT, BIT, before=STAMP - 5 - 160)[0] and not looked(BIT, BIT, before=STAMP - 5 - 159)[0]


def test_a_start_bit_is_looked_for_exactly_while_no_byte_is_received() -> None:
    for kind in (HUNT, START):
        assert looked(BIT, kind, receiving=0)[0] and not looked(BIT, kind, receiving=3)[0]
    for kind in (WAIT, BIT):
        assert looked(BIT, kind, receiving=3)[0] and not looked(BIT, kind, receiving=0)[0]


def test_gaps_are_those_before_a_start_and_within_a_byte() -> None:
    start = {(STAMP, STAMP - SAMPLE, SAMPLE - BEFORE)}
    wait = {((BEFORE + 5) % 256, STAMP - (BEFORE + 5))}
    for last, kind in product((HUNT, START, WAIT, BIT, SENT), (HUNT, START, WAIT, BIT)):
        _, starts, waits = looked(last, kind)
        assert starts == (start if kind == START and last in (HUNT, BIT) else set()), (last, kind)
        assert waits == (wait if kind in (WAIT, BIT) and last in (START, WAIT, BIT) else set()), (last, kind)


def test_of_two_looks_the_earlier_one_stands_for_both() -> None:
    """It can do all that the later one can, and the gap that it ends is larger."""
    (far,), (near,) = (looked(HUNT, START, before=before)[1] for before in (-60, -50))
    assert looked(HUNT, START, before=-50, others=(-60,))[1] == {far, near}
    assert far[2] == near[2] + 10 and far in looked(HUNT, START, before=-60, others=(-50,))[1]
