"""What single words of a stream's interrupt do to its time: followed, refused or allowed."""

from __future__ import annotations

from typing import Any

import pytest

from servogen.engines.stream.response import (
    AHEAD,
    CLEARED,
    WRITTEN,
    Round,
    _left_with_fall,
    _loop_head,
    _only,
    main_loop,
)
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, INDF, ZERO, W, word_of
from servogen.pic.listing import ListedFunction, Listing, ListingRow
from servogen.prove.stream import interrupt as theorem
from servogen.prove.stream.interrupt import (
    ANY,
    BIT,
    FALL,
    HUNT,
    NO_LOOK,
    PLAIN,
    RISE,
    SENT,
    START,
    WAIT,
    InterruptChanged,
    _check_looks,
    _check_receiver,
    _check_samples,
    _check_writes,
    _Closure,
    _End,
    _Interrupt,
    _Look,
    _looks,
)

TMR0, STATUS, FSR_FILE, PORTA, PORTB, INTCON = 1, 3, 4, 5, 6, 11
OWN = ("ticks", "rest", "fine", "t", "rx_bits", "rx_left", "rx_last")
RAM = {name: 0x20 + n for n, name in enumerate(OWN)}
RAM |= {"due": 0x30, "mask": 0x31, "next_hi": 0x32, "next_lo": 0x33}
RAM |= {"rx_byte": 0x34, "command": 0x35, "todo": 0x36, "value": 0x37}


def round_of(*words: int, at: int = 4, look: int = 0x60, edge: int = 0x70, masked: int = 9) -> Round:
    return Round(dict(enumerate(words, at)), RAM, look, edge, masked)


def steps(
    code: Round, word: int, known: dict[int, int], *, now: int = 50, stack: tuple[int, ...] = ()
) -> Any:
    return [
        (address, more, cycles, dict(after))
        for address, more, cycles, after in code.steps(0x10, stack, now, word_of(word), dict(known))
    ]


# one instruction


def test_jumps_calls_and_returns_take_two_cycles() -> None:
    code = round_of()
    assert steps(code, encode("GOTO", k=0x55), {}) == [(0x55, (), 2, {})]
    assert steps(code, encode("CALL", k=0x55), {}, stack=(1,)) == [(0x55, (1, 0x11), 2, {})]
    assert steps(code, encode("RETURN"), {}, stack=(1, 7)) == [(7, (1,), 2, {})]
    assert steps(code, encode("RETURN"), {}) == [(-1, (), 2, {})], "the end of a subroutine by itself"


def test_a_skip_takes_a_cycle_more_if_it_skips() -> None:
    code = round_of()
    test = encode("BTFSS", f=0x20, b=1)
    assert steps(code, test, {0x20: 2}) == [(0x12, (), 2, {0x20: 2})]
    assert steps(code, test, {0x20: 1}) == [(0x11, (), 1, {0x20: 1})]
    assert [(at, cycles) for at, _, cycles, _ in steps(code, test, {})] == [(0x11, 1), (0x12, 2)]


def test_other_instructions_take_a_cycle_and_change_what_is_known() -> None:
    code = round_of()
    assert steps(code, encode("MOVLW", k=9), {W: 1}) == [(0x11, (), 1, {W: 9})]
    clear = encode("BCF", f=INTCON, b=2)
    assert steps(code, clear, {CLEARED: 0}) == [(0x11, (), 1, {CLEARED: 1})]
    assert CLEARED not in steps(code, clear, {})[0][3], "counted only after an edge"
    # A write to a port through the pointer changes no byte; through another pointer any byte may be another.
    store = encode("MOVWF", f=INDF)
    assert steps(code, store, {W: 1, FSR: PORTB, 0x20: 5})[0][3] == {W: 1, FSR: PORTB, 0x20: 5}
    assert steps(code, store, {W: 1, FSR: 0x20, 0x20: 5})[0][3].get(0x20) != 5


def test_a_look_lasts_as_long_as_it_may_and_leaves_its_variables_unknown() -> None:
    code = round_of(
        encode("BTFSS", f=PORTA, b=4), encode("GOTO", k=0x63), encode("NOP"), encode("RETURN"), at=0x60
    )
    # Skipped: 2, NOP 1, RETURN 2; else 1, GOTO 2, RETURN 2.
    assert code.looks() == (5,)
    longer = round_of(
        encode("BTFSS", f=PORTA, b=4), encode("RETURN"), encode("NOP"), encode("RETURN"), at=0x60
    )
    assert longer.looks() == (3, 5)
    known = {W: 1, CARRY: 0, ZERO: 1, RAM["t"]: 5, RAM["fine"]: 6}
    found = steps(longer, encode("CALL", k=0x60), known)
    assert [(at, more, cycles) for at, more, cycles, _ in found] == [(0x11, (), 5), (0x11, (), 7)]
    assert all(after == {RAM["fine"]: 6} for *_, after in found)


# the timer


def test_the_timer_reads_the_cycle_and_what_it_is_ahead() -> None:
    code = round_of()
    read = encode("MOVF", f=TMR0, d=0)
    for now, ahead, value in ((50, 0, 50), (255, 0, 255), (256, 0, 0), (200, 128, 72)):
        ((_, _, cycles, after),) = steps(code, read, {AHEAD: ahead}, now=now)
        assert (cycles, after[W], after[ZERO]) == (1, value, int(value == 0))
    subtract = encode("SUBWF", f=TMR0, d=0)
    ((_, _, _, after),) = steps(code, subtract, {AHEAD: 0, W: 60}, now=50)
    # 50 less 60 borrows: the carry is clear.
    assert (after[W], after[CARRY], after[ZERO]) == (246, 0, 0)
    ((_, _, _, after),) = steps(code, subtract, {AHEAD: 0, W: 50, CARRY: 0}, now=50)
    assert (after[W], after[CARRY], after[ZERO]) == (0, 1, 1)
    ((_, _, _, after),) = steps(code, subtract, {AHEAD: 0, CARRY: 1, ZERO: 1}, now=50)
    assert W not in after and CARRY not in after and ZERO not in after
    ((_, _, _, after),) = steps(code, read, {AHEAD: 0, CARRY: 1}, now=50)
    assert after[CARRY] == 1, "MOVF leaves the carry"
    for b in range(8):
        for name in ("BTFSS", "BTFSC"):
            ((at, _, cycles, _),) = steps(code, encode(name, f=TMR0, b=b), {AHEAD: 0}, now=0b1010_0110)
            skips = (0b1010_0110 >> b & 1 == 1) == (name == "BTFSS")
            assert (at, cycles) == (0x11 + skips, 1 + skips)


def test_a_constant_that_is_added_to_the_timer_costs_three_cycles() -> None:
    """TMR0 does not count in the cycle of the write and the two after it (DS35007 figure 5-2)."""
    code = round_of()
    add = encode("ADDWF", f=TMR0, d=1)
    ((at, _, cycles, after),) = steps(code, add, {AHEAD: 0, W: 131, CARRY: 1, ZERO: 0}, now=50)
    assert (at, cycles, after) == (0x11, 1, {AHEAD: 128, WRITTEN: 50, W: 131})
    ((_, _, _, after),) = steps(code, add, {AHEAD: 128, W: 100}, now=5)
    assert after[AHEAD] == (128 + 100 - 3) % 256
    # 50 + 205 is 255, and one more overflows.
    assert steps(code, add, {AHEAD: 0, W: 205}, now=50)
    with pytest.raises(LookupError, match=r"^TMR0 overflows because it is written$"):
        steps(code, add, {AHEAD: 0, W: 206}, now=50)
    for word, known in (
        (add, {AHEAD: 0}),
        (encode("MOVWF", f=TMR0), {AHEAD: 0, W: 1}),
        (encode("CLRF", f=TMR0), {AHEAD: 0, W: 1}),
        (encode("SUBWF", f=TMR0, d=1), {AHEAD: 0, W: 1}),
    ):
        with pytest.raises(LookupError, match=r"^TMR0 is written by an instruction that is not followed$"):
            steps(code, word, known)
    read = encode("MOVF", f=TMR0, d=0)
    for now in (51, 52, 53):
        with pytest.raises(LookupError, match=r"^TMR0 is read while it does not count$"):
            steps(code, read, {AHEAD: 0, WRITTEN: 50}, now=now)
    assert steps(code, read, {AHEAD: 0, WRITTEN: 50}, now=54)
    assert steps(code, read, {AHEAD: 0}, now=1)


# rounds

RETFIE = encode("RETFIE")
NOP = encode("NOP")


def test_a_round_leaves_what_its_interrupt_does_not_take() -> None:
    # Two cycles, and from cycle 2 to 8 on: the latest end is 8 + 3 + 2 + ... of 256.
    code = round_of(NOP, NOP, NOP, RETFIE)
    assert code.left(range(2, 9)) == 256 - (8 + 3 + 2)
    assert code.left(range(2, 3)) == 256 - (2 + 3 + 2)
    # An interrupt that ends so late that the next round's would be delayed has no bound.
    long = round_of(*[NOP] * 244, RETFIE)
    assert long.left(range(2, 7)) == 256 - (6 + 244 + 2)
    assert long.left(range(2, 8)) is None
    assert round_of(NOP).left(range(2, 3)) is None, "it leaves its words"
    assert round_of(encode("GOTO", k=4)).left(range(2, 3)) is None, "it does not end"


def test_a_round_with_two_interrupts_leaves_what_both_do_not_take() -> None:
    second = (
        encode("MOVLW", k=128 + 3),
        encode("BTFSC", f=RAM["ticks"], b=0),
        encode("ADDWF", f=TMR0, d=1),
        encode("BTFSS", f=RAM["ticks"], b=0),
        encode("GOTO", k=11),
        encode("GOTO", k=13),
        NOP,
        encode("MOVLW", k=131),  # 11: TMR0 again 128 ahead, so that the round is over
        encode("ADDWF", f=TMR0, d=1),
        encode("NOP"),
        RETFIE,
    )
    code = round_of(*second, masked=0)
    # MOVLW, BTFSC and ADDWF one cycle each, BTFSS that skips and GOTO two, NOP one, RETFIE two.
    assert code._latest(4, 2, {RAM["ticks"]: 101, AHEAD: 0}) == ((2 + 3 + 4 + 1 + 2, 128, 0),)
    # MOVLW one, BTFSC that skips two, BTFSS one, GOTO two, MOVLW, ADDWF and NOP one each, RETFIE two.
    assert code._latest(4, 130, {RAM["ticks"]: 100, AHEAD: 128}) == ((130 + 3 + 3 + 3 + 2, 0, 0),)
    # Between them to cycle 128, and after the second one, which begins up to six cycles after it.
    assert code.left(range(2, 3)) == (128 - 12) + 256 - (134 + 11)
    # Where the C masks interrupts for nine cycles, it begins so much later.
    assert round_of(*second, masked=9).left(range(2, 3)) == (128 - 12) + 256 - (143 + 11)


@pytest.mark.parametrize(
    ("fall", "late", "left"),
    [
        (None, 0, None),
        # The next round has no other interrupt: both rounds, if it ends in time.
        ((500, True), 0, 12),
        ((508, True), 0, 4),
        ((509, True), 0, None),
        # It ends within its round: the rest of it and a usual one.
        ((200, False), 0, 56 + 90),
        ((251, False), 0, 5 + 90),
        # Else the next round's interrupt begins late.
        ((252, False), 70, 4 + 70),
        ((300, False), 99, 0 + 90),
        ((300, False), None, None),
    ],
)
def test_what_a_fall_leaves_of_two_rounds(
    fall: tuple[int, bool] | None, late: int | None, left: int | None
) -> None:
    asked = []

    class Fallen:
        masked = 9

        def end_after_edge(self, rest: int, fine: int) -> Any:
            assert (rest, fine) == (3, 7)
            return fall

        def left(self, begins: range) -> Any:
            asked.append(begins)
            return late

    one: Any = Fallen()
    assert _left_with_fall(one, 3, 7, 90) == left
    if fall is not None and not fall[1] and fall[0] >= 252:
        begin = max(2, fall[0] - 256)
        assert asked == [range(begin, begin + 4 + 2 + 9)]


# the C's loop


def listing(words: dict[int, int], **more: Any) -> Listing:
    rows = tuple(ListingRow(at, word, "", "1") for at, word in sorted(words.items()))
    return Listing(rows, **more)


def test_the_main_loop_is_found_by_what_it_clears() -> None:
    due = 0x30
    words = {
        0: encode("GOTO", k=5),
        5: encode("MOVLW", k=0xA0),
        6: encode("MOVWF", f=INTCON),
        7: NOP,
        8: encode("BTFSS", f=due, b=1),
        9: encode("GOTO", k=8),
        10: encode("ANDWF", f=due, d=1),
        11: encode("GOTO", k=7),
        12: NOP,
    }
    functions = (ListedFunction("other", 0, 5), ListedFunction("_main", 5, 12))
    found = listing(words, functions=functions, variables=((due, "due", 1),))
    # The first target of a jump back after interrupts are enabled.
    assert main_loop(found) == (7, 10)
    assert _loop_head(words, functions[1], 7) == 8
    assert _only(iter([3])) == 3
    for wrong in ([], [3, 4]):
        with pytest.raises(ValueError):
            _only(iter(wrong))


# what the interrupt may write


EDGE = 0x70


def refused(
    word: int, *, at: int = 0x50, words: dict[int, int] | None = None, looking: tuple[int, ...] = ()
) -> bool:
    variables = (
        (0x40, "goal_low", 2),
        (0x44, "W (temporary)", 2),
        *((f, name, 1) for name, f in RAM.items()),
    )
    ran = (words or {}) | {at: word}
    try:
        _check_writes(ran, RAM, listing(ran, variables=variables), looking, EDGE)
    except InterruptChanged as error:
        assert str(error) == f"the word at 0x{at:03X} writes what is not the interrupt's"
        return True
    return False


def check_writes(ran: dict[int, int]) -> None:
    _check_writes(ran, RAM, listing(ran), (), EDGE)


def test_the_interrupt_writes_its_own_variables_and_no_others() -> None:
    for name in ("ticks", "rest", "fine", "t"):
        assert not refused(encode("MOVWF", f=RAM[name])), name
    for name in ("rx_bits", "rx_left", "rx_last", "rx_byte", "command", "todo", "value"):
        assert refused(encode("MOVWF", f=RAM[name])), name
        assert not refused(encode("MOVWF", f=RAM[name]), looking=(0x50,)), "by a look, which is checked apart"
    for f in (0x44, 0x45):
        assert not refused(encode("MOVWF", f=f)), "the context, which the compiler keeps"
    for f in (0x40, 0x41, 0x46, RAM["next_hi"], RAM["next_lo"], 10, 2, 8):
        assert refused(encode("MOVWF", f=f)), hex(f)
        assert not refused(encode("MOVF", f=f, d=0)), "reading it changes nothing"
    for f in (PORTA, PORTB, INDF):
        assert not refused(encode("MOVWF", f=f), at=EDGE), "checked where it is executed"
        with pytest.raises(InterruptChanged, match=r"^the word at 0x050 writes a port$"):
            check_writes({0x50: encode("MOVWF", f=f)})
    assert not refused(encode("MOVWF", f=TMR0)), "checked where it is executed"
    with pytest.raises(InterruptChanged, match=r"^the word at 0x050 jumps to an edge$"):
        check_writes({0x50: encode("GOTO", k=EDGE)})


def test_of_the_registers_only_some_bits_are_the_interrupt_s() -> None:
    for b in range(8):
        assert refused(encode("BCF", f=INTCON, b=b)) == (b != 2), "T0IF"
        assert refused(encode("BSF", f=INTCON, b=b))
        assert refused(encode("BCF", f=STATUS, b=b)) == (b not in (0, 5, 6)), "the carry and the bank"
        assert refused(encode("BSF", f=STATUS, b=b)) == (b != 0)
        assert refused(encode("BCF", f=RAM["due"], b=b)) and not refused(encode("BSF", f=RAM["due"], b=b))
    assert not refused(encode("CLRF", f=STATUS)) and refused(encode("MOVWF", f=INTCON))
    assert not refused(encode("MOVWF", f=FSR_FILE)) and refused(encode("INCF", f=FSR_FILE, d=1))


def test_a_pin_is_cleared_only_where_the_c_is_late() -> None:
    late = {
        0x4E: encode("BTFSS", f=RAM["due"], b=1),
        0x4F: encode("GOTO", k=0x52),
        0x51: encode("BSF", f=RAM["due"], b=0),
    }
    clear = encode("CLRF", f=RAM["mask"])
    assert not refused(clear, words=late)
    assert refused(clear) and refused(encode("MOVWF", f=RAM["mask"]), words=late)
    for at in (0x4E, 0x51):
        assert refused(clear, words=late | {at: encode("BTFSS", f=RAM["due"], b=2)})


def test_another_bank_is_selected_only_where_the_c_goes_on() -> None:
    """All addresses are of bank 0: in bank 1, PORTB is TRISB, and TMR0 is OPTION_REG (DS35007 figure 2-2)."""
    swap, end = encode("SWAPF", f=0x44, d=0), encode("RETFIE")
    restore = encode("MOVWF", f=STATUS)
    for after in ([end], [swap, end], [swap, swap, end]):
        assert not refused(restore, words=dict(enumerate(after, 0x51)))
    for after in ([], [swap], [swap, encode("RETURN")], [encode("MOVF", f=TMR0, d=0), end]):
        assert refused(restore, words=dict(enumerate(after, 0x51)))
    for name in ("ANDWF", "IORWF", "COMF", "SWAPF"):
        assert refused(encode(name, f=STATUS, d=1), words={0x51: end})


@pytest.mark.parametrize(
    ("word", "name"),
    [(0x0063, "SLEEP"), (0x0062, "OPTION"), (0x0065, "TRIS"), (0x0066, "TRIS"), (encode("CLRWDT"), None)],
)
def test_words_that_stop_the_chip_or_turn_its_pins_round_are_refused(word: int, name: str | None) -> None:
    """Their codes are those of DS35007 table 9-2, and of DS30561, section 4."""
    run = {0x50: word}
    if name is None:
        check_writes(run)
    else:
        with pytest.raises(InterruptChanged, match=f"^{name} at 0x050 is not followed$"):
            check_writes(run)


# the receiver's words


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


def test_each_word_that_keeps_the_receiver_s_time_is_the_one_that_is_expected() -> None:
    """Times are 64 units of 4 cycles: the timer, half a round ahead while `ticks` is even, shifted twice."""
    _check_receiver(receiver(), RAM, 0x60, 0x80, 104, 15)
    for at in receiver():
        words = receiver() | {at: NOP}
        if at == 0x67:  # where a broken byte goes on
            _check_receiver(words, RAM, 0x60, 0x80, 104, 15)
            continue
        with pytest.raises(InterruptChanged) as error:
            _check_receiver(words, RAM, 0x60, 0x80, 104, 15)
        clock = f"the receiver's clock is not kept by the word at 0x{at:03X}"
        assert str(error.value) == ("a start bit is not looked for at a pin" if at == 0x80 else clock)
    for units, first in ((105, 15), (104, 16)):
        with pytest.raises(InterruptChanged):
            _check_receiver(receiver(), RAM, 0x60, 0x80, units, first)
    for sample in (encode("BTFSS", f=PORTA, b=4), encode("BTFSC", f=7, b=4)):
        with pytest.raises(InterruptChanged, match=r"^a start bit is not looked for at a pin$"):
            _check_receiver(receiver() | {0x80: sample}, RAM, 0x60, 0x80, 104, 15)
    _check_receiver(receiver() | {0x80: encode("BTFSC", f=PORTB, b=0)}, RAM, 0x60, 0x80, 104, 15)


def test_a_bit_is_sampled_20_to_30_cycles_after_its_time_and_the_stop_bit_by_22() -> None:
    def check(code: Round) -> str:
        try:
            _check_samples(code, 0x60)
        except InterruptChanged as error:
            return str(error)
        return ""

    def straight(count: int) -> Round:
        words = (
            encode("MOVF", f=TMR0, d=0),
            encode("ADDWF", f=RAM["rx_left"], d=1),
            *[NOP] * (count - 2),
            encode("BTFSC", f=PORTA, b=4),
            NOP,
            encode("RETURN"),
        )
        return round_of(*words, at=0x60)

    for cycles, right in ((19, False), (20, True), (22, True), (23, False)):
        text = f"a bit is sampled {cycles} cycles after its time stamp, at 0x{0x60 + cycles:03X}"
        assert check(straight(cycles)) == ("" if right else text)

    # Bits other than the stop bit, before which rx_bits is 1, have until 30.
    def unless_stop(count: int) -> Round:
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
        return round_of(*words, at=0x60)

    for cycles, right in ((19, False), (20, True), (30, True), (31, False)):
        assert (check(unless_stop(cycles)) == "") == right, cycles


def test_every_outcome_of_a_look_has_its_times() -> None:
    words = dict(receiver())
    code = Round(words, RAM, 0x60, 0x70, 9)
    hunting = _looks(code, 0x80, 0x80)
    # None there: the sample skips nothing (1) and RETURN (2). A start: 2, and the time is read in cycle 2.
    assert _Look(HUNT, 3, 0, 0) in hunting
    (start,) = (look for look in hunting if look.kind == START)
    # The skip over RETURN two cycles, eleven words one each (a skip over ADDLW as long as it), RETURN two.
    assert (start.sample, start.stamp, start.cycles) == (0, 2, 2 + 11 + 2)
    assert {look.kind for look in hunting} == {HUNT, START}
    taking = dict(words) | {0x67: encode("RETURN"), 0x72: encode("RETURN")}
    looks = _looks(Round(taking, RAM, 0x60, 0x99, 9), 0x60, 0x80)
    kinds = {look.kind for look in looks}
    assert kinds == {WAIT, BIT}
    assert all((look.stamp, look.sample) == (0, 20) for look in looks)
    # The time takes six cycles. A broken byte: BTFSC and RETURN; else the skip and six words, then the test
    # of the carry and RETURN, or the skip, two words and RETURN.
    assert {look.cycles for look in looks if look.kind == WAIT} == {6 + 1 + 2, 6 + 2 + 6 + 1 + 2}
    assert {look.cycles for look in looks if look.kind == BIT} == {6 + 2 + 6 + 2 + 2 + 2}


def test_an_interrupt_that_stands_still_has_no_look_and_no_edge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(theorem, "MAX_STATES", 50)
    with pytest.raises(InterruptChanged, match=r"^a look at the line does not end$"):
        _looks(round_of(encode("GOTO", k=0x60), at=0x60), 0x60, 0x80)
    with pytest.raises(LookupError, match=r"^the interrupt makes no edge$"):
        round_of(encode("GOTO", k=4), at=4, edge=0x70).rise()


# gaps


def interrupt(*, gaps: bool = True, out: tuple[int, int] | None = None) -> _Interrupt:
    return _Interrupt(round_of(), {}, out, gaps, bits_apart=160, first_apart=61)


def test_looks_follow_each_other_as_a_receiver_can() -> None:
    def follows(
        last: tuple[str, int, int], kind: str, stamp: int, *, out: tuple[int, int] | None = None
    ) -> bool:
        return interrupt(out=out)._may_follow(last, _Look(kind, 9, 0, 0), stamp)

    start = (START, 0, 2)
    # After a start bit a wait, or the first bit once it is due.
    assert follows(start, WAIT, 5) and not follows(start, HUNT, 500) and not follows(start, START, 500)
    assert follows(start, BIT, 63) and not follows(start, BIT, 62)
    # A byte does not begin while one is received; after a bit it may be over.
    hunt, bit, wait = (HUNT, 0, 2), (BIT, 0, 2), (WAIT, 0, 2)
    assert follows(hunt, HUNT, 5) and follows(hunt, START, 5) and follows(bit, START, 5)
    assert follows(wait, START, 5) and follows(bit, WAIT, 5) and follows(wait, BIT, 5)
    assert not follows(hunt, WAIT, 5) and not follows(hunt, BIT, 5)
    # With a pin to answer on, a bit may be sent while none was received; no start bit comes meanwhile.
    assert follows(hunt, BIT, 5, out=(5, 3)) and follows(hunt, WAIT, 5, out=(5, 3))
    assert not follows((SENT, 0, 2), START, 5) and not follows((SENT, 0, 2), HUNT, 5)


def test_gaps_are_those_before_a_start_and_within_a_byte() -> None:
    one = interrupt()
    one._note_gap((HUNT, 10, 12), (START, 110, 370))
    one._note_gap((BIT, 20, 25), (START, 110, 112))
    assert one.starts == {(370 % 256, 260, 100), (112, 2, 90)} and one.waits == set()
    for last in (START, WAIT, BIT):
        for kind in (WAIT, BIT):
            one.waits.clear()
            one._note_gap((last, 10, 270), (kind, 110, 390))
            assert one.waits == {(14, 120)}
    one.waits.clear()
    one.starts.clear()
    for last, kind in ((WAIT, START), (SENT, BIT), (HUNT, BIT), (HUNT, HUNT), (START, START), ("", START)):
        one._note_gap((last, 10, 20), (kind, 110, 120))
    assert not one.starts and not one.waits


def test_an_edge_clears_the_port_or_writes_what_the_c_prepared() -> None:
    mask = encode("MOVF", f=RAM["mask"], d=0)
    edge, through = word_of(encode("MOVWF", f=PORTB)), word_of(encode("MOVWF", f=INDF))
    code = round_of(mask, encode("MOVWF", f=PORTB), at=0x6F, edge=0x70)
    one = _Interrupt(code, {}, None, False, 160, 61)
    rest = RAM["rest"]
    one._check_edge(edge, {rest: 0})
    one._check_edge(edge, {rest: 5, W: 0})
    one._check_edge(through, {rest: 0, FSR: PORTA})
    for known in ({}, {W: 0}, {rest: 5}, {rest: 5, W: 1}):
        with pytest.raises(InterruptChanged, match=r"^a fall does not clear the port$"):
            one._check_edge(edge, known)
    for word, pointer in ((word_of(encode("MOVWF", f=7)), PORTB), (through, 0x20), (through, 0x86)):
        with pytest.raises(InterruptChanged, match=r"^an edge is not written to a port$"):
            one._check_edge(word, {rest: 0, FSR: pointer})
    with pytest.raises(InterruptChanged, match=r"^an edge is not written to a port$"):
        one._check_edge(through, {rest: 0})
    other = _Interrupt(round_of(NOP, NOP, at=0x6F, edge=0x70), {}, None, False, 160, 61)
    other._check_edge(edge, {rest: 5, W: 0})
    with pytest.raises(InterruptChanged, match=r"^a rise does not write the pin that the C prepared$"):
        other._check_edge(edge, {rest: 0})


def test_a_look_at_the_line_writes_the_receiver_s_variables_and_the_transmit_pin() -> None:
    def check(word: int, out: tuple[int, int] | None = (PORTA, 3)) -> None:
        _check_looks({0x55: word, 0x56: encode("CLRF", f=PORTB)}, RAM, [0x55], out)

    for name in ("BSF", "BCF"):
        check(encode(name, f=PORTA, b=3))
    for name in ("t", "rx_bits", "rx_left", "rx_last", "rx_byte", "command", "todo", "value"):
        check(encode("MOVWF", f=RAM[name]))
    check(encode("BCF", f=STATUS, b=0))
    check(encode("MOVF", f=PORTB, d=0))
    other = r"^a look at the line writes what is not its own, at 0x055$"
    for word in (
        encode("BSF", f=PORTA, b=2),
        encode("BSF", f=PORTB, b=3),
        encode("MOVWF", f=PORTA),
        encode("CLRF", f=PORTA),
        encode("BSF", f=STATUS, b=5),
        encode("MOVWF", f=INDF),
        encode("MOVWF", f=TMR0),
        *(encode("CLRF", f=RAM[name]) for name in ("ticks", "rest", "fine", "due", "mask", "next_hi")),
    ):
        with pytest.raises(InterruptChanged, match=other):
            check(word)
    with pytest.raises(InterruptChanged, match=other):
        check(encode("BSF", f=PORTA, b=3), None)
    with pytest.raises(InterruptChanged, match=r"^a look at the line ends the interrupt at 0x055$"):
        check(encode("RETFIE"))


# the states in which interrupts begin


def closure(*, gaps: bool = False, masked: int = 9, fines: tuple[int, ...] = ()) -> _Closure:
    layout: Any = None
    return _Closure(interrupt(gaps=gaps), layout, fines, masked, lambda *_: None, "edges")


def test_an_interrupt_begins_within_its_latency_after_its_overflow_or_the_one_before() -> None:
    one = closure()
    # Two cycles after the overflow at the earliest; latency, an instruction of two cycles, and masks.
    assert one._begins(0, -50) == range(2, 4 + 2 + 9 + 1)
    assert one._begins(0, 30) == range(30, 30 + 15 + 1)
    assert one._begins(128, 129) == range(130, 129 + 15 + 1)
    # For samples, what does not wait for an interrupt begins three cycles after it, less or more one.
    gaps = closure(gaps=True, masked=0)
    assert gaps._begins(128, 100) == range(130, 132)
    assert gaps._begins(128, 128) == range(130, 128 + 4 + 1) and gaps._begins(0, 30) == range(30, 35)


def test_a_state_stands_for_those_that_can_do_no_more() -> None:
    one = closure(gaps=True)
    one._add(True, 5, (BIT, 10, 20), PLAIN + RISE)
    one._add(True, 5, (BIT, 10, 20), PLAIN)
    one._add(True, 5, (BIT, 11, 20), RISE)
    assert one._waiting == [(True, (5, BIT, PLAIN + RISE))]
    one._add(True, 5, (BIT, 9, 20), PLAIN)  # an earlier look: a larger gap
    one._add(True, 5, (BIT, 12, 22), ANY)  # more kinds of rounds
    one._add(True, 6, (BIT, 12, 22), PLAIN)
    one._add(True, 5, (WAIT, 12, 22), PLAIN)
    one._add(False, 5, (BIT, 12, 22), PLAIN)
    assert len(one._waiting) == 6 and len(one.firsts) == 5 and len(one.seconds) == 1
    assert one.firsts[5, BIT, PLAIN] == (BIT, 9, 20)
    before = list(one._waiting)
    one._add(True, 5, (BIT, 8, 20), PLAIN)
    assert one._waiting == before and one.firsts[5, BIT, PLAIN] == (BIT, 8, 20), "it waits already"
    # Without gaps only the bit's time counts, and no bit at all stands for every one.
    exact = closure()
    exact._add(True, 5, NO_LOOK, PLAIN)
    exact._add(True, 5, (BIT, 10, 20), PLAIN)
    assert exact._waiting == [(True, (5, "", PLAIN))]
    exact._add(True, 6, (BIT, 10, 20), PLAIN)
    assert exact.firsts[6, BIT, PLAIN] == (BIT, 20, 20)


def test_the_next_round_s_times_count_from_its_own_beginning() -> None:
    one = closure(gaps=True, masked=0)
    end = _End(280, 0, False, 5, 0, 0, (BIT, 200, 230))
    one._next(end, 1, PLAIN)
    assert {begin for begin, _, _ in one.firsts} == set(range(24, 24 + 5))
    assert set(one.firsts.values()) == {(BIT, -56, -26)}
    two = closure(gaps=True, masked=0)
    two._next(_End(280, 0, False, 5, 0, 0, NO_LOOK), 2)
    assert {(begin, may) for begin, _, may in two.firsts} == {(2, ANY), (3, ANY)}
    assert set(two.firsts.values()) == {NO_LOOK}


def test_an_end_that_is_not_the_expected_one_is_named() -> None:
    one = closure()
    end = _End(280, 128, False, 5, 6, 0, NO_LOOK)
    one._check(True, "a rise", end)
    with pytest.raises(InterruptChanged) as error:
        one._check(False, "a rise", end)
    assert str(error.value) == "a rise: it ends with TMR0 128 cycles ahead, ticks 5, rest 6"


def test_what_a_round_may_be_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def ends(*found: _End) -> Any:
        return lambda *_: list(found)

    def run(method: str, source: str, end: _End, *arguments: Any) -> set[tuple[int, str]]:
        one = closure(masked=0)
        monkeypatch.setattr(_Closure if source == "_edge" else _Interrupt, source, ends(end))
        getattr(one, method)([(2, NO_LOOK)], *arguments)
        return {(min(begin for begin, _, _ in one.firsts), may) for _, _, may in one.firsts}

    def end(cycle: int, ahead: int, ticks: int, rest: int = 0, cleared: bool = False) -> _End:
        return _End(cycle, ahead, cleared, ticks, rest, 0, NO_LOOK)

    assert run("_first", "run", end(200, 0, 99)) == {(2, ANY)}
    assert run("_second", "run", end(270, 0, 99)) == {(14, ANY)}
    assert run("_rise", "_edge", end(200, 0, 99)) == {(2, PLAIN + FALL)}
    # After a fall with one interrupt left the next rise is in the next round; else that has no edge.
    monkeypatch.setattr(theorem, "LATEST", 1000)

    def fall(*found: _End) -> set[str]:
        one = closure(masked=0)
        outcomes = iter(found)
        monkeypatch.setattr(_Closure, "_edge", lambda *_: [next(outcomes)])
        one._fall([(2, NO_LOOK)], 7)
        return {may for _, _, may in one.firsts}

    assert fall(end(200, 0, 1), end(200, 0, 101)) == {RISE, PLAIN}
    assert fall(end(400, 0, -1, cleared=True), end(400, 0, 99, cleared=True)) == {PLAIN + RISE}
    for wrong in (end(200, 128, 1), end(200, 0, 2), end(200, 0, 1, rest=1)):
        with pytest.raises(InterruptChanged, match=r"^a fall: it ends"):
            fall(wrong)
