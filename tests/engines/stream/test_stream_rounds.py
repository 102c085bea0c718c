"""What a word of a stream's interrupt does to its time (DS35007 section 5), and what a round leaves the C."""

from __future__ import annotations

import pytest

from servogen.engines.stream.interrupt_code import (
    AFTER_EDGE,
    BEFORE_EDGE,
    SPANS_NEXT_ROUND,
    InterruptCode,
    TimedState,
    Timer,
)
from servogen.engines.stream.response import InterruptTimes
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, INDF, ZERO, Known, W

TMR0, PORTA, PORTB, INTCON = 1, 5, 6, 11
RAM = {name: 0x20 + n for n, name in enumerate(("ticks", "rest", "fine", "t"))}
NOP, RETFIE = encode("NOP"), encode("RETFIE")
AS_THE_TIME = Timer()


def code_of(*words: int, at: int = 4) -> InterruptCode:
    return InterruptCode(dict(enumerate(words, at)), RAM, 0x60, 0x70)


def round_of(*words: int, masked: int = 9) -> InterruptTimes:
    return InterruptTimes(code_of(*words), masked)


def after(word: int, known: Known, timer: Timer = AS_THE_TIME, now: int = 50) -> TimedState:
    """What follows a word at 0x10, of which one thing must follow."""
    code = code_of(word, at=0x10)
    (found,) = code.successors(TimedState(0x10, (), now, dict(known), timer), code.word(0x10))
    return found


@pytest.mark.parametrize(("now", "ahead", "value"), [(50, 0, 50), (255, 0, 255), (256, 0, 0), (200, 128, 72)])
def test_the_timer_reads_the_cycle_and_what_it_is_ahead(now: int, ahead: int, value: int) -> None:
    found = after(encode("MOVF", f=TMR0, d=0), {CARRY: 1}, Timer(ahead), now)
    assert (found.address, found.cycle) == (0x11, now + 1)
    assert found.known == {W: value, ZERO: int(value == 0), CARRY: 1}


def test_the_timer_is_compared_as_any_byte_is() -> None:
    subtract = encode("SUBWF", f=TMR0, d=0)
    # 50 less 60 borrows: the carry is clear.
    assert after(subtract, {W: 60}).known == {W: 246, CARRY: 0, ZERO: 0}
    assert after(subtract, {W: 50, CARRY: 0}).known == {W: 0, CARRY: 1, ZERO: 1}
    assert after(subtract, {CARRY: 1, ZERO: 1}).known == {}
    for b in range(8):
        for name, skips_on in (("BTFSS", 1), ("BTFSC", 0)):
            skips = 0b1010_0110 >> b & 1 == skips_on
            found = after(encode(name, f=TMR0, b=b), {}, now=0b1010_0110)
            assert (found.address, found.cycle) == (0x11 + skips, 0b1010_0110 + 1 + skips)


def test_a_constant_that_is_added_to_the_timer_costs_three_cycles() -> None:
    """TMR0 does not count in the cycle of the write and the two after it (DS35007 figure 5-2)."""
    add = encode("ADDWF", f=TMR0, d=1)
    found = after(add, {W: 131, CARRY: 1, ZERO: 0})
    assert (found.address, found.cycle, found.known, found.timer) == (0x11, 51, {W: 131}, Timer(128, 50))
    assert after(add, {W: 100}, Timer(128), now=5).timer.ahead == (128 + 100 - 3) % 256
    # 50 + 205 is 255, and one more overflows.
    assert after(add, {W: 205}).timer.written == 50
    with pytest.raises(LookupError, match=r"^TMR0 overflows because it is written$"):
        after(add, {W: 206})
    for word, known in (
        (add, {}),
        (encode("MOVWF", f=TMR0), {W: 1}),
        (encode("CLRF", f=TMR0), {W: 1}),
        (encode("SUBWF", f=TMR0, d=1), {W: 1}),
        (encode("DECFSZ", f=TMR0, d=0), {W: 1}),
    ):
        with pytest.raises(LookupError, match=r"^TMR0 is written by an instruction that is not followed$"):
            after(word, known)
    with pytest.raises(LookupError, match=r"^TMR0 is written by an instruction that is not followed$"):
        after(add, {W: 1}, Timer(0, 40))
    for now in (51, 52, 53):
        with pytest.raises(LookupError, match=r"^TMR0 is read while it does not count$"):
            after(encode("MOVF", f=TMR0, d=0), {}, Timer(0, 50), now)
    assert after(encode("MOVF", f=TMR0, d=0), {}, Timer(0, 50), 54).known[W] == 54


def test_a_flag_that_is_cleared_counts_only_after_an_edge() -> None:
    clear = encode("BCF", f=INTCON, b=2)
    assert after(clear, {}, Timer(phase=AFTER_EDGE)).timer.phase is SPANS_NEXT_ROUND
    assert after(clear, {}).timer.phase is BEFORE_EDGE


def test_a_write_of_a_port_through_the_pointer_changes_no_byte() -> None:
    store = encode("MOVWF", f=INDF)
    for port in (PORTA, PORTB):
        assert after(store, {W: 1, FSR: port, 0x20: 5}).known == {W: 1, FSR: port, 0x20: 5}
    assert after(store, {W: 1, FSR: 0x20, 0x20: 5}).known[0x20] == 1
    assert 0x20 not in after(store, {W: 1, 0x20: 5}).known, "an unknown pointer: any byte"


def test_a_look_lasts_as_long_as_it_may_and_leaves_its_variables_unknown() -> None:
    test, back = encode("BTFSS", f=PORTA, b=4), encode("RETURN")
    # Skipped: 2, NOP 1, RETURN 2; else 1, GOTO 2, RETURN 2.
    assert code_of(test, encode("GOTO", k=0x63), NOP, back, at=0x60).look_cycles == (5,)
    code = code_of(test, back, NOP, back, at=0x60)
    assert code.look_cycles == (3, 5)
    call = code_of(encode("CALL", k=0x60)).word(4)
    known = {W: 1, CARRY: 0, ZERO: 1, RAM["t"]: 5, RAM["fine"]: 6}
    found = code.successors(TimedState(0x10, (7,), 50, known), call)
    assert [(at.address, at.stack, at.cycle) for at in found] == [(0x11, (7,), 55), (0x11, (7,), 57)]
    assert all(at.known == {RAM["fine"]: 6} for at in found)


def test_a_round_leaves_what_its_interrupt_does_not_take() -> None:
    # The latest begins in cycle 8: three NOPs, and RETFIE takes two cycles.
    code = round_of(NOP, NOP, NOP, RETFIE)
    assert code.cycles_left(range(2, 9)) == 256 - (8 + 3 + 2)
    assert code.cycles_left(range(2, 3)) == 256 - (2 + 3 + 2)
    # An interrupt that ends so late that the next round's would be delayed has no bound.
    long = round_of(*[NOP] * 244, RETFIE)
    assert long.cycles_left(range(2, 7)) == 256 - (6 + 244 + 2)
    assert long.cycles_left(range(2, 8)) is None
    assert round_of(NOP).cycles_left(range(2, 3)) is None, "it leaves its words"
    assert round_of(encode("GOTO", k=4)).cycles_left(range(2, 3)) is None, "it does not end"
    with pytest.raises(LookupError, match=r"^the interrupt makes no edge$"):
        _ = round_of(encode("GOTO", k=4)).rise


def test_a_round_with_two_interrupts_leaves_what_both_do_not_take() -> None:
    words = (
        encode("MOVLW", k=128 + 3),
        encode("BTFSC", f=RAM["ticks"], b=0),
        encode("ADDWF", f=TMR0, d=1),
        encode("BTFSS", f=RAM["ticks"], b=0),
        encode("GOTO", k=11),
        encode("GOTO", k=13),
        NOP,
        encode("MOVLW", k=131),  # 11: TMR0 again 128 ahead, so that the round is over
        encode("ADDWF", f=TMR0, d=1),
        NOP,
        RETFIE,
    )
    # The first ends 12 cycles after the overflow: MOVLW, BTFSC and ADDWF one cycle each, BTFSS that skips and
    # GOTO two, NOP one, RETFIE two. The second begins up to six cycles after cycle 128 and takes 11: MOVLW
    # one, BTFSC that skips two, BTFSS one, GOTO two, MOVLW, ADDWF and NOP one each, RETFIE two.
    assert round_of(*words, masked=0).cycles_left(range(2, 3)) == (128 - 12) + 256 - (134 + 11)
    # Where the C masks interrupts for nine cycles, it begins so much later.
    assert round_of(*words, masked=9).cycles_left(range(2, 3)) == (128 - 12) + 256 - (143 + 11)
