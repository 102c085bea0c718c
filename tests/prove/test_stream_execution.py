"""The symbolic execution of every instruction, as the second chip of the tests and DS35007 have it."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterable, Mapping

import pytest

from servogen.pic.image import Image
from servogen.pic.isa import by_mnemonic, encode
from servogen.prove.stream import execution
from servogen.prove.stream.bits import FALSE, TRUE, Bits, Solver, Truth, byte, unknown
from servogen.prove.stream.execution import RETURNED, Access, Execution, NotFollowed, SymbolicState
from tests.simulator.reference import Chip

pytest.importorskip("bitwuzla", reason="the solver is not installed")

INDF, TMR0, PCL, STATUS, FSR, PORTA, PORTB = range(7)
EEDATA, EEADR, PCLATH, INTCON = 8, 9, 10, 11
OPTION, TRISA, TRISB, EECON1, EECON2 = 0x81, 0x85, 0x86, 0x88, 0x89
EEPROM = 0x100
AT = 0x40
"""Where the instruction is that is executed."""
RAM = 0x20
TO_AND_PD = 0x18

BYTES = (0x00, 0x01, 0x0F, 0x10, 0x7F, 0x80, 0xAA, 0xFF)


def begun(
    words: Mapping[int, int] | int, known: Mapping[int, Bits] | None = None, pc: int = AT
) -> tuple[Execution, SymbolicState]:
    """A state before the words, or before one at `AT`; W is 0 and the flags are clear."""
    one = Execution({pc: words} if isinstance(words, int) else words, Solver())
    state = one.state(pc, known or {})
    state.w = byte(0)
    state.carry = state.digit_carry = state.zero = FALSE
    return one, state


def stepped(one: Execution, state: SymbolicState) -> SymbolicState:
    (after,) = one.step(state)
    return after


def flags(state: SymbolicState) -> tuple[bool | None, bool | None, bool | None]:
    return state.carry.known, state.digit_carry.known, state.zero.known


NOT_FOLLOWED = ("SLEEP", "OPTION", "TRIS")


@pytest.mark.parametrize("name", sorted(by_mnemonic().keys() - NOT_FOLLOWED))
def test_an_instruction_does_what_the_second_chip_of_the_tests_does(name: str) -> None:
    """W, the byte, STATUS, the next address, the stack, and what was read and written."""
    dice = random.Random(name)
    for f, w, flags_before in itertools.product((*BYTES, 2, 0xFE), BYTES, (0, 7)):
        wide = 1024 if name in ("GOTO", "CALL") else 256
        fields = {"f": RAM, "d": dice.randrange(2), "b": dice.randrange(8), "k": dice.randrange(wide)}
        word = encode(name, **{field: fields[field] for field in by_mnemonic()[name].operands})
        chip = Chip(Image({AT: word}))
        chip.pc, chip.w, chip.ram[RAM - 0x0C], chip.status = AT, w, f, TO_AND_PD | flags_before
        chip.push(5)
        chip.push(0x155)
        chip.execute()
        one, state = begun(word, {RAM: byte(f), STATUS: byte(TO_AND_PD)})
        state.w, state.stack = byte(w), (5, 0x155)
        state.carry = state.digit_carry = state.zero = Truth(bool(flags_before))
        after = stepped(one, state)
        assert (after.w.value, one.byte(after, RAM).value) == (chip.w, chip.ram[RAM - 0x0C]), (f, w)
        assert (after.pc, list(after.stack)) == (chip.pc, chip.stack[: chip.depth]), (f, w)
        assert one.status(after).value == chip.status, (f, w)
        assert (one.reads, bool(one.writes)) == (chip.read_unwritten, chip.written[RAM - 0x0C]), (f, w)
        assert one.byte(state, RAM).value == f, "the state before is kept"


def test_a_subroutine_alone_returns_to_no_address_of_the_program() -> None:
    assert RETURNED not in range(1024)


def test_what_is_unknown_goes_both_ways_if_both_are_possible() -> None:
    one, state = begun(encode("BTFSS", f=RAM, b=3))
    successors = list(one.step(state))
    assert sorted(successor.pc for successor in successors) == [AT + 1, AT + 2]
    for successor in successors:
        bit = one.initial(RAM).bit(3)
        assert one.solver.possible(successor.path & bit) == (successor.pc == AT + 2)
        assert one.solver.possible(successor.path & ~bit) == (successor.pc == AT + 1)
    one, state = begun(encode("BTFSS", f=RAM, b=3))
    one.precondition = one.initial(RAM).less(8)
    assert [successor.pc for successor in one.step(state)] == [AT + 1]
    one, state = begun(encode("INCFSZ", f=RAM, d=1))
    assert sorted(successor.pc for successor in one.step(state)) == [AT + 1, AT + 2]


def test_a_return_without_a_call_is_not_followed() -> None:
    one, state = begun(encode("RETURN"))
    with pytest.raises(NotFollowed, match=r"^a return without a call at 0x040$"):
        stepped(one, state)


@pytest.mark.parametrize(
    ("f", "bank", "place"),
    [
        *((f, bank, f) for f in (STATUS, FSR, PCLATH, INTCON, 0x0C, 0x4F) for bank in (0, 1)),
        *((f, 0, f) for f in (TMR0, PORTA, PORTB, EEDATA, EEADR)),
        (TMR0, 1, OPTION),
        (PORTA, 1, TRISA),
        (PORTB, 1, TRISB),
        (EEDATA, 1, EECON1),
        (EEADR, 1, EECON2),
    ],
)
def test_rp0_selects_the_bank(f: int, bank: int, place: int) -> None:
    """DS35007 figure 2-2: what is in both banks, and what is not."""
    one, state = begun(encode("MOVF", f=f, d=0))
    state.bank = bank
    stepped(one, state)
    assert one.reads == {place}
    # FSR addresses the same, with its bit 7 as the bank, whatever RP0 is.
    one, state = begun(encode("MOVF", f=INDF, d=0), {FSR: byte(f | bank << 7)})
    state.bank = 1 - bank
    stepped(one, state)
    assert one.reads == {place}


def test_an_unknown_pointer_is_followed_to_each_place() -> None:
    one, state = begun(encode("MOVF", f=INDF, d=0))
    pointer = one.initial(FSR)
    one.precondition = ~pointer.less(0x10) & pointer.less(0x13)
    successors = list(one.step(state))
    assert len(successors) == 3 and one.reads == {0x10, 0x11, 0x12}
    for successor, place in itertools.product(successors, one.reads):
        read = successor.w.equals(one.initial(place))
        assert not one.solver.possible(one.precondition & successor.path & pointer.equals(place) & ~read)


def test_status_is_put_together_from_its_flags_and_the_bank() -> None:
    for carry, digit, zero, bank in itertools.product((0, 1), repeat=4):
        one, state = begun(encode("MOVF", f=STATUS, d=0), {STATUS: byte(0b1101_1000)})
        state.carry, state.digit_carry, state.zero = (Truth(bool(bit)) for bit in (carry, digit, zero))
        state.bank = bank
        assert one.status(state).value == 0b1101_1000 | bank << 5 | zero << 2 | digit << 1 | carry
    one, state = begun(encode("MOVWF", f=STATUS), {STATUS: byte(0b0001_1000)})
    state.w = byte(0b0010_0101)
    after = stepped(one, state)
    assert (after.bank, flags(after)) == (1, (True, False, True))
    # TO and PD (bits 4 and 3) cannot be written.
    assert one.status(after).value == 0b0011_1101 and one.writes == {STATUS}
    state.w = byte(0b0000_0010)
    after = stepped(one, state)
    assert (after.bank, flags(after)) == (0, (False, True, False))
    state.w = unknown("W")
    with pytest.raises(NotFollowed, match=r"^an unknown bank is selected at 0x040$"):
        stepped(one, state)


def test_single_bits_of_status() -> None:
    for bit, name in itertools.product((0, 1, 2), ("BSF", "BCF")):
        one, state = begun(encode(name, f=STATUS, b=bit), {STATUS: byte(0)})
        before = Truth(name == "BCF")
        state.carry = state.digit_carry = state.zero = before
        after = stepped(one, state)
        assert flags(after) == tuple((name == "BSF") if n == bit else before.known for n in range(3))
        assert after.pc == AT + 1 and one.writes == {STATUS}
        for test in ("BTFSS", "BTFSC"):
            one, state = begun(encode(test, f=STATUS, b=bit), {STATUS: byte(0)})
            state.carry, state.digit_carry, state.zero = (Truth(n == bit) for n in range(3))
            assert stepped(one, state).pc == AT + (2 if test == "BTFSS" else 1)
            assert one.reads == set()
    for name, bank in (("BSF", 1), ("BCF", 0)):
        one, state = begun(encode(name, f=STATUS, b=5), {STATUS: byte(0)})
        state.bank = 1 - bank
        assert stepped(one, state).bank == bank
    for bit in (6, 7):
        one, state = begun(encode("BCF", f=STATUS, b=bit))
        assert stepped(one, state).pc == AT + 1
        one, state = begun(encode("BSF", f=STATUS, b=bit))
        with pytest.raises(NotFollowed, match=r"^IRP or RP1 is set at 0x040$"):
            stepped(one, state)


def test_what_time_and_pins_change_is_read_anew_each_time() -> None:
    for f in (TMR0, PORTA, PORTB):
        one, state = begun(encode("MOVF", f=f, d=0))
        first = stepped(one, state)
        assert first.w is one.initial(f) and first.accesses == (Access(f),) and one.reads == {f}
        first.pc = AT
        second = stepped(one, first)
        assert second.accesses == (Access(f), Access(f))
        assert one.solver.possible(~second.w.equals(first.w)), "another look may give another value"
    one, state = begun(encode("MOVF", f=RAM, d=0))
    assert stepped(one, state).accesses == (), "a byte of RAM stays as it is"


def test_a_bit_of_a_port_changes_its_latch_only() -> None:
    for f in (PORTA, PORTB):
        one, state = begun(encode("BSF", f=f, b=1), {f: byte(0b1000)})
        after = stepped(one, state)
        assert one.byte(after, f).value == 0b1010 and after.accesses == ()
        assert one.reads == {f} == one.writes


def test_registers_without_content_read_as_0() -> None:
    def through_the_pointer(name: str, place: int) -> tuple[Execution, SymbolicState]:
        one, state = begun(encode(name, f=INDF), {FSR: byte(place)})
        state.w = byte(9)
        return one, stepped(one, state)

    for place in (INDF, 0x80, EECON2, 0x07, 0x50):
        assert through_the_pointer("MOVF", place)[1].w.value == 0
    for place in (0x4F, 0x0C):
        assert through_the_pointer("MOVF", place)[1].w.value is None
    for place in (INDF, 0x80, EECON2):
        one, after = through_the_pointer("MOVWF", place)
        assert place not in after.bytes and place in one.writes
    one, state = begun(encode("BTFSC", f=PCL, b=0))
    with pytest.raises(NotFollowed, match=r"^PCL is read at 0x040$"):
        stepped(one, state)


def test_the_flags_of_intcon_are_never_known() -> None:
    one, state = begun(encode("MOVF", f=INTCON, d=0), {INTCON: byte(0b1010_0111)})
    read = stepped(one, state).w
    assert read[3:8].value == 0b10100 and all(read.bit(n).known is None for n in range(3))
    one, state = begun(encode("BSF", f=INTCON, b=3), {INTCON: byte(0b1010_0111)})
    assert one.byte(stepped(one, state), INTCON).value == 0b1010_1111, "a bit that changes leaves the others"


def test_a_computed_jump_goes_to_each_target() -> None:
    one, state = begun(encode("ADDWF", f=PCL, d=1), {PCLATH: byte(0b11110)})
    state.w = byte(3)
    # The low byte of the next address plus 3, in the page of PCLATH's bits 1 and 0.
    assert stepped(one, state).pc == 0x200 + AT + 4
    state.w = unknown("W")
    one.precondition = state.w.less(3)
    assert sorted(successor.pc for successor in one.step(state)) == [0x241, 0x242, 0x243]
    one, state = begun(encode("ADDWF", f=PCL, d=1))
    with pytest.raises(NotFollowed, match=r"^PCLATH is not known at 0x040$"):
        stepped(one, state)
    one, state = begun(encode("MOVWF", f=PCL), {PCLATH: byte(1)})
    state.w = byte(0x44)
    assert stepped(one, state).pc == 0x144


@pytest.mark.parametrize("name", NOT_FOLLOWED)
def test_what_is_not_followed_is_named(name: str) -> None:
    one, state = begun(encode(name, **({"f": 5} if name == "TRIS" else {})))
    with pytest.raises(NotFollowed, match=f"^{name} at 0x040 is not followed$"):
        stepped(one, state)


def test_where_there_is_no_instruction_the_execution_ends() -> None:
    for words in ({}, {AT: 0x0002}):  # no word, and one that no data sheet defines
        one, state = begun(words)
        with pytest.raises(NotFollowed, match=r"^there is no instruction at 0x040$"):
            stepped(one, state)


# the EEPROM


def unlocking(write: int, *, last: int = 0xAA) -> dict[int, int]:
    """The words of DS35007 example 3-2 from `AT` - 4 on, and at `AT` the one that starts the write."""
    words = [("MOVLW", {"k": 0x55}), ("MOVWF", {"f": 9}), ("MOVLW", {"k": last}), ("MOVWF", {"f": 9})]
    return {AT - 4 + n: encode(name, **operands) for n, (name, operands) in enumerate(words)} | {AT: write}


def written(one: Execution, state: SymbolicState, begin: int = AT - 4) -> SymbolicState:
    """The state after the words from `begin` to `AT`, and whatever they jump to until then."""
    state.pc = begin
    while state.pc != AT + 1:
        state = stepped(one, state)
    return state


START_WRITE = encode("BSF", f=8, b=1)
START_READ = encode("BSF", f=8, b=0)


def eeprom(
    words: Mapping[int, int], *, address: int = 5, intcon: int = 0x20, eecon1: int = 0b100
) -> tuple[Execution, SymbolicState]:
    """A state before `AT` in bank 1; writing is enabled, interrupts are not."""
    values = {EEADR: address, EEDATA: 0x66, INTCON: intcon, EECON1: eecon1, EEPROM + 5: 0x77}
    one, state = begun(words, {place: byte(value) for place, value in values.items()})
    state.bank = 1
    return one, state


def test_a_byte_of_the_eeprom_is_read() -> None:
    one, state = eeprom({AT: START_READ})
    after = stepped(one, state)
    assert one.byte(after, EEDATA).value == 0x77 and one.byte(after, EEPROM + 5).value == 0x77
    # Writing is not started, and the other bits do not read.
    for bit in range(1, 5):
        one, state = eeprom({AT: encode("BSF", f=8, b=bit)})
        assert one.byte(stepped(one, state), EEDATA).value == 0x66


def test_a_byte_of_the_eeprom_is_written_only_after_the_unlocking_words() -> None:
    one, state = eeprom(unlocking(START_WRITE))
    after = written(one, state)
    assert one.byte(after, EEPROM + 5).value == 0x66 and one.byte(after, EEDATA).value == 0x66
    right = unlocking(START_WRITE)
    # A NOP between the words, which are moved down by one from there.
    late = {at - 1: word for at, word in right.items() if at < AT - 1} | {AT - 2: encode("NOP")}
    for words, eecon1, begin in (
        (unlocking(START_WRITE, last=0xAB), 0b100, AT - 4),
        (right, 0b100, AT),
        (right, 0b100, AT - 3),  # the first word is jumped over
        (right, 0b000, AT - 4),  # writing is not enabled
        (unlocking(encode("BSF", f=8, b=3)), 0b100, AT - 4),  # another bit
        (right | late, 0b100, AT - 5),
    ):
        one, state = eeprom(words, eecon1=eecon1)
        assert one.byte(written(one, state, begin), EEPROM + 5).value == 0x77
    one, state = eeprom(right)
    state.bank = 0  # EECON2 is EEADR there
    assert written(one, state).unlocked == 0
    # A sequence that begins anew is one.
    again = {AT - 6: right[AT - 4], AT - 5: right[AT - 3]}
    one, state = eeprom(right | again)
    assert one.byte(written(one, state, AT - 6), EEPROM + 5).value == 0x66


def test_an_eeprom_that_is_being_written_is_left_alone() -> None:
    using = r"^the EEPROM is used at 0x041 while it is being written$"
    for name, f, bank in (("MOVWF", 8, 0), ("CLRF", 9, 0), ("BSF", 8, 1)):
        operands = {"b": 0} if name == "BSF" else {}
        one, state = eeprom(unlocking(START_WRITE) | {AT + 1: encode(name, f=f, **operands)})
        after = written(one, state)
        after.bank = bank
        with pytest.raises(NotFollowed, match=using):
            stepped(one, after)
    one, state = eeprom(unlocking(START_WRITE) | {AT + 1: encode("BCF", f=8, b=2)})
    assert one.byte(stepped(one, written(one, state)), EECON1).value == 0, "no more writes are enabled"


def test_the_reads_of_a_watched_variable_and_the_visits_of_an_address_are_counted() -> None:
    words = {
        AT: encode("DECFSZ", f=RAM, d=1),
        AT + 1: encode("GOTO", k=AT),
        AT + 2: encode("MOVF", f=RAM, d=0),
    }
    one, state = begun(words, {RAM: Bits(6, 0).concat(unknown("n", 2))})
    one.watched, one.counted = frozenset({RAM}), AT
    one.precondition = ~one.initial_bytes[RAM].equals(0)
    ends = one.run(state, {AT + 3})
    # n turns for n of 1 to 3, a read in each, and one behind the loop.
    assert sorted((end.reads_of(RAM), end.visits) for end in ends) == [(2, 1), (3, 2), (4, 3)]
    assert one.visits == 3


def test_what_is_not_sure_of_the_eeprom_is_not_followed() -> None:
    one, state = eeprom(unlocking(START_WRITE), intcon=0x80)
    enabled = r"^the EEPROM is written while interrupts are enabled, at 0x040$"
    with pytest.raises(NotFollowed, match=enabled):
        written(one, state)
    state.bytes[INTCON] = unknown("INTCON")
    with pytest.raises(NotFollowed, match=enabled):
        written(one, state)
    for address, known in ((63, True), (64, False)):
        one, state = eeprom({AT: START_READ}, address=address)
        if known:
            assert one.byte(stepped(one, state), EEDATA) is one.initial(EEPROM + 63)
        else:
            with pytest.raises(NotFollowed, match=r"^the EEPROM's address is not known at 0x040$"):
                stepped(one, state)
    one, state = eeprom({AT: START_READ})
    state.bytes[EEADR] = unknown("EEADR")
    with pytest.raises(NotFollowed, match=r"^the EEPROM's address is not known at 0x040$"):
        stepped(one, state)
    one, state = eeprom({AT: encode("MOVWF", f=8)})
    state.w = unknown("W")
    with pytest.raises(NotFollowed, match=r"^EECON1 is written with an unknown value at 0x040$"):
        stepped(one, state)


def test_whether_a_write_is_under_way_is_not_known() -> None:
    one, state = eeprom({AT: encode("MOVF", f=8, d=0)}, eecon1=0b1_1111)
    after = stepped(one, state)
    # RD reads as 0; WR and EEIF may be either, WREN and WRERR are as they were.
    assert after.w.bit(0).known is False and after.w.bit(1).known is None
    assert after.w[2:4].value == 0b11 and after.w.bit(4).known is None and len(one.eeprom_busy) == 1
    assert one.solver.possible(after.w.bit(1)) and one.solver.possible(~after.w.bit(1))
    assert not one.solver.possible(one.eeprom_busy[0] & ~after.w.bit(1))
    one, state = eeprom({AT: encode("BSF", f=8, b=2)}, eecon1=0b1_1011)
    after = stepped(one, state)
    assert one.byte(after, EECON1).value == 0b1_1100, "another bit starts neither a read nor a write"


# runs


def program(*words: int, at: int = AT) -> dict[int, int]:
    return dict(enumerate(words, at))


def values_of(one: Execution, ends: Iterable[SymbolicState], place: int) -> set[int]:
    found = set()
    for end in ends:
        left = one.precondition & end.path
        while one.solver.possible(left):
            value = one.solver.example(one.byte(end, place))
            found.add(value)
            left = left & ~one.byte(end, place).equals(value)
    return found


def test_ways_that_meet_become_one_state() -> None:
    words = program(
        encode("CLRF", f=RAM),
        encode("BTFSC", f=0x30, b=0),
        encode("INCF", f=RAM, d=1),
        encode("BTFSC", f=0x30, b=1),
        encode("BSF", f=RAM, b=2),
        encode("NOP"),
        encode("NOP"),
    )
    one, state = begun(words)
    (end,) = one.run(state, {AT + 6})
    assert end.pc == AT + 6
    assert values_of(one, [end], RAM) == {0, 1, 4, 5}
    for low in range(4):
        given = one.initial(0x30)[0:2].equals(low) & end.path
        assert one.solver.possible(given)
        assert one.solver.example(one.byte(end, RAM)) == (low & 1) + 2 * (low & 2)
    assert not one.solver.possible(~end.path), "together the ways are all ways"


def test_a_loop_is_followed_to_its_end_or_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    words = program(encode("DECFSZ", f=RAM, d=1), encode("GOTO", k=AT), encode("NOP"))
    one, state = begun(words, {RAM: byte(5)})
    (end,) = one.run(state, {AT + 2})
    assert one.byte(end, RAM).value == 0
    # Five DECFSZ, four GOTO: eight states after the first one, the end, and the look that finds nothing left.
    for most, refused in ((10, False), (9, True)):
        monkeypatch.setattr(execution, "MAX_STEPS", most)
        one, state = begun(words, {RAM: byte(5)})
        if refused:
            with pytest.raises(NotFollowed, match=r"^the program does not come to an end, at 0x040$"):
                one.run(state, {AT + 2})
        else:
            assert len(one.run(state, {AT + 2})) == 1


def test_a_stop_counts_only_outside_of_subroutines_unless_anywhere() -> None:
    words = program(encode("CALL", k=0x60), encode("NOP")) | program(encode("NOP"), encode("RETURN"), at=0x60)
    one, state = begun(words)
    assert [end.pc for end in one.run(state, {0x61, AT + 1})] == [AT + 1]
    one, state = begun(words)
    assert [end.pc for end in one.run(state, {0x61, AT + 1}, anywhere=True)] == [0x61]
    one, state = begun(words, pc=0x60)
    state.stack = (RETURNED,)
    assert [end.pc for end in one.run(state, set())] == [RETURNED]


def test_states_with_different_banks_stay_apart() -> None:
    words = program(encode("BTFSC", f=RAM, b=0), encode("BSF", f=STATUS, b=5), encode("NOP"), encode("NOP"))
    one, state = begun(words)
    ends = one.run(state, {AT + 3})
    assert sorted(end.bank for end in ends) == [0, 1]
    covered = ends[0].path | ends[1].path
    assert not one.solver.possible(ends[0].path & ends[1].path) and not one.solver.possible(~covered)


def test_flags_and_w_depend_on_the_way() -> None:
    words = program(
        encode("MOVLW", k=1),
        encode("BTFSC", f=RAM, b=0),
        encode("ADDLW", k=0xFF),
        encode("NOP"),
        encode("NOP"),
    )
    one, state = begun(words)
    (end,) = one.run(state, {AT + 4})
    bit = one.initial(RAM).bit(0)
    for truth, wanted in ((end.carry, bit), (end.digit_carry, bit), (end.zero, bit)):
        assert not one.solver.possible((truth & ~wanted) | (~truth & wanted))
    assert one.solver.possible(bit) and one.solver.example(end.w) == 0
    assert one.solver.possible(~bit) and one.solver.example(end.w) == 1


def test_a_first_state_knows_what_it_was_given() -> None:
    one = Execution({}, Solver())
    state = one.state(7, {RAM: byte(3)}, (1, 2))
    assert (state.pc, state.stack, state.bank, state.path) == (7, (1, 2), 0, TRUE)
    assert one.initial(RAM).value == 3 and one.byte(state, RAM).value == 3
    assert one.byte(state, 0x21) is one.initial(0x21)
    assert state.w.value is None and flags(state) == (None, None, None)
