"""One step of an abstract state: at reset, through pointers, of ports, latches, the timer and flags, and
where two states meet.
"""

from __future__ import annotations

import pytest

from servogen.pic.analysis import values
from servogen.pic.analysis.state import (
    BANK,
    DIGIT,
    INTCON,
    LATCHES,
    OPTION,
    PCLATH,
    TMR0,
    TRISA,
    TRISB,
    AbstractState,
    Effects,
    at_interrupt,
    at_reset,
    bit,
    bits,
    computed,
    execute,
    operands,
    skip_ways,
)
from servogen.pic.analysis.values import ANY, BIT, Value
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, ZERO, W, word_of
from tests.campaigns import sampled
from tests.pic.analysis.programs import assembled
from tests.pic.analysis.test_state import new_chip


def state_of(known: dict[int, int | Value], written: int = 0) -> AbstractState:
    """Return a state that knows these values, in bank 0 unless they say otherwise."""
    whole: dict[int, int | Value] = {BANK: 0} | known
    return AbstractState(
        {place: values.constant(v) if isinstance(v, int) else v for place, v in whole.items()}, written
    )


def words(text: str) -> list[int]:
    """Return the words of some instructions."""
    program = assembled(text).image.program
    return [program[address] for address in range(len(program))]


def step(text: str, before: AbstractState, at: int = 0) -> tuple[AbstractState, Effects]:
    """Return the state after one instruction, and its effects."""
    return execute(before, word_of(words(text)[0]), at)


def run(text: str, state: AbstractState) -> AbstractState:
    """Return the state after some instructions."""
    for number in words(text):
        state, _ = execute(state, word_of(number), 0)
    return state


# DS35007 table 6-3: what a power-on reset guarantees.
AT_RESET = {OPTION: 0xFF, TRISA: 0x1F, TRISB: 0xFF, PCLATH: 0, INTCON: 0, BANK: 0}


def test_a_reset_sets_six_registers_and_leaves_the_rest_unknown_and_unwritten() -> None:
    state = at_reset()
    assert {place: value.constant for place, value in state.values.items()} == AT_RESET
    assert state.written == bits(AT_RESET)
    for place in (*range(0x0C, 0x50), W, FSR, CARRY, DIGIT, ZERO, TMR0, *range(LATCHES, LATCHES + 13)):
        assert not state.has_written(place)
        assert state.get(place) is (BIT if place in (CARRY, DIGIT, ZERO) else ANY)
    assert (state.saved, state.facts, state.copies) == ({}, {}, ())


def test_a_pointer_with_more_than_half_of_all_addresses_is_taken_to_address_ram() -> None:
    for pointer in (ANY, values.of_bits(0xFF, 0xFF)):
        found, unknown = operands(state_of({FSR: pointer}), 0)
        assert unknown
        assert [each.place for each in found] == list(range(0x0C, 0x50))
    _, unknown = operands(state_of({FSR: values.of_bits(0xFF, 0x7F)}), 0)
    assert not unknown, "128 addresses"


@pytest.mark.parametrize(
    ("f", "expected"),
    [
        (0x07, {0}), (0x50, {0}), (0x7F, {0}),  # unimplemented: read as 0
        (0x05, None), (0x06, None), (0x08, None), (0x09, None), (0x01, None),
        (0x02, {0x35}),  # PCL holds the address of the next instruction when it is read
        (0x0B, {0xA0 | low for low in range(8)}),  # the three flags may be set at any time
        (0x0A, {3}), (0x04, {0x20}), (0x20, {9}),
    ],
)  # fmt: skip
def test_what_a_read_of_a_register_finds(f: int, expected: set[int] | None) -> None:
    before = state_of({INTCON: 0xA0, PCLATH: 3, FSR: 0x20, 0x20: 9})
    after, _ = execute(before, word_of(encode("MOVF", f=f, d=0)), 0x134)
    assert set(after.get(W)) == (set(range(256)) if expected is None else expected)
    if f not in (2, 0x0A):
        through, _ = execute(before.copy(), word_of(encode("MOVF", f=f, d=0)), 0x134)
        assert through.get(W) is after.get(W)


def test_pcl_is_read_modulo_256() -> None:
    assert step(" movf PCL, w", state_of({}), 0x1FF)[0].get(W).constant == 0


@pytest.mark.parametrize("pointer", [0x00, 0x08, 0x09, 0x88, 0x89, 0x07])
def test_a_pointer_to_a_register_that_is_not_followed_reads_anything(pointer: int) -> None:
    assert step(" movf INDF, w", state_of({FSR: pointer}))[0].get(W) is ANY


@pytest.mark.parametrize(
    ("text", "unwritten"),
    [
        (" movf TMR0, w", {TMR0}), (" movwf TMR0", {W}), (" movf STATUS, w", {CARRY, DIGIT, ZERO}),
        (" btfsc STATUS, 0", {CARRY}), (" btfss STATUS, 1", {DIGIT}), (" btfsc STATUS, 2", {ZERO}),
        (" btfsc STATUS, 3", set()), (" btfsc STATUS, 5", {BANK}), (" bsf STATUS, 0", set()),
        (" bcf STATUS, 2", set()), (" movf INDF, w", {FSR}), (" clrf INDF", {FSR}), (" movf PORTB, w", set()),
        (" movf INTCON, w", set()), (" movf PCL, w", set()), (" option", {W}), (" tris 6", {W}),
        (" retlw 4", set()), (" goto 0", set()),
    ],
)  # fmt: skip
def test_what_is_used_that_was_never_written(text: str, unwritten: set[int]) -> None:
    assert step(text, state_of({}))[1].unwritten == unwritten
    known = state_of({}, bits((TMR0, W, CARRY, DIGIT, ZERO, BANK, FSR)))
    assert step(text, known)[1].unwritten == set()


def test_a_read_through_a_pointer_uses_the_bytes_that_it_may_address() -> None:
    two = state_of({FSR: values.of({0x20, 0x31})}, bits((FSR, 0x31)))
    assert step(" movf INDF, w", two)[1].unwritten == {0x20}
    assert not step(" movf INDF, w", two)[1].any_byte
    anywhere = state_of({FSR: ANY}, bits((FSR,)))
    read, write = step(" movf INDF, w", anywhere)[1], step(" clrf INDF", anywhere)[1]
    assert (read.unwritten, read.any_byte, read.wild) == (set(), True, False)
    assert (write.unwritten, write.any_byte, write.wild) == (set(), False, True)


@pytest.mark.parametrize(
    ("text", "w", "pins"),
    [
        (" bsf PORTB, 3", {0}, [(6, 0x08, 0x08)]),
        (" bcf PORTB, 7", {0}, [(6, 0x80, 0x80)]),
        (" bcf PORTA, 0", {0}, [(5, 0x01, 0x01)]),
        (" movwf PORTB", {0x81, 0x01}, [(6, 0x81, 0x01)]),
        (" movwf PORTA", {0x00, 0x10}, [(5, 0x10, 0x00)]),
        (" clrf PORTA", {0}, [(5, 0, 0)]),
        (" movf PORTA, w", {0}, []),
        (" btfsc PORTA, 1", {0}, []),
    ],
)
def test_the_pins_that_a_write_of_a_port_means(
    text: str, w: set[int], pins: list[tuple[int, int, int]]
) -> None:
    state, effects = step(text, state_of({W: values.of(w)}))
    assert effects.pins == pins
    latches = {5: range(LATCHES, LATCHES + 5), 6: range(LATCHES + 5, LATCHES + 13)}
    written: list[int] = []
    for port, may, _ in pins:
        every = text.split()[0] in ("movwf", "clrf")
        written += [place for number, place in enumerate(latches[port]) if every or may >> number & 1]
    assert state.written & bits(range(LATCHES, LATCHES + 13)) == bits(written)


@pytest.mark.parametrize(
    ("text", "written"),
    [
        (" bcf PORTB, 0", 0xF1),
        (" andwf PORTB, f", 0xFE),
        (" iorwf PORTB, f", 0xF1),
        (" incf PORTB, f", 0xF0),
        (" movwf PORTB", 0xFF),
    ],
)
def test_a_latch_holds_no_value_of_the_program_once_an_instruction_has_read_its_input(
    text: str, written: int
) -> None:
    """RB0 to RB3 are inputs; what is read of them is written to their latches, but for bits that are known:
    W is 1, and of a byte ANDed with it seven bits are 0.
    """
    latches = [LATCHES + 5 + pin for pin in range(8)]
    before = state_of({W: values.of({1}), TRISB: values.of({0x0F})}, bits(latches))
    after = step(text, before)[0].written
    assert [bit for bit, place in enumerate(latches) if after & bits((place,))] == [
        bit for bit in range(8) if written >> bit & 1
    ]


def test_a_pointer_that_may_address_both_ports_writes_neither_for_certain() -> None:
    state, effects = step(" movwf INDF", state_of({FSR: values.of({5, 6}), W: 3}))
    assert sorted(effects.pins) == [(5, 3, 0), (6, 3, 0)]
    assert state.written == 0
    state, effects = step(" movwf INDF", state_of({FSR: values.of({1, 3}), W: 3}))
    assert not state.has_written(TMR0)
    assert effects.changed >= {TMR0, CARRY, ZERO, DIGIT, BANK}
    assert set(state.get(CARRY)) == {0, 1}, "1 is written, or it keeps the value that it had"


def test_pins_become_outputs_before_their_latches_are_written() -> None:
    in_bank_1 = {BANK: 1}
    _, effects = step(" movwf PORTB", state_of(in_bank_1 | {W: values.of({0xF0, 0xB0})}))
    assert effects.driven_unwritten == {5, 6, 7, 8, 11}, "RB0 to RB3, and RB6 perhaps"
    _, effects = step(" clrf PORTA", state_of(in_bank_1, bit(LATCHES) | bit(LATCHES + 3)))
    assert effects.driven_unwritten == {1, 2, 4}
    state, effects = step(" tris 5", state_of({W: 0xE7}))
    assert effects.driven_unwritten == set()
    assert (state.get(TRISA).constant, state.has_written(TRISA)) == (0x07, True), "five bits exist"
    assert step(" tris 6", state_of({W: 0xE7}))[0].get(TRISB).constant == 0xE7
    assert step(" option", state_of({W: 0xE7}))[0].get(OPTION).constant == 0xE7


def test_writes_of_the_timer_and_of_pcl_through_a_pointer_are_reported() -> None:
    state, effects = step(" movwf TMR0", state_of({W: values.of({3, 9})}))
    assert effects.timer_writes is values.of({3, 9})
    assert (effects.changed, state.has_written(TMR0), TMR0 in state.values) == ({TMR0}, True, False)
    _, effects = step(" movwf INDF", state_of({FSR: values.of({1, 0x20}), W: 3}))
    assert effects.timer_writes is values.constant(3)
    assert not effects.jumps
    assert step(" movwf INDF", state_of({FSR: values.of({2, 0x20}), W: 3}))[1].jumps


@pytest.mark.parametrize(
    ("text", "before", "after"),
    [
        (" bsf INTCON, 7", {0x20}, {0xA0}),
        (" bsf INTCON, 5", {0x00}, {0x20}),
        (" bcf INTCON, 2", {0x20}, {0x20}),
        (" bcf INTCON, 7", {0xA0}, {0x20, 0xA0}),  # an interrupt during it sets GIE again as it returns
        (" bcf INTCON, 7", {0x80}, {0x00}),  # none is enabled
        (" clrf INTCON", {0xA0}, {0x00, 0x80}),
        (" clrf INTCON", {0x20}, {0x00}),
        (" bcf INTCON, 5", {0xA0}, {0x80}),
    ],
)
def test_the_enable_bits_of_interrupts_after_a_write(text: str, before: set[int], after: set[int]) -> None:
    state, effects = step(text, state_of({INTCON: values.of(before)}))
    assert set(state.get(INTCON)) == after
    assert effects.changed == {INTCON} | ({ZERO} if "clrf" in text else set())


COMPARED = [
    *(f" movlw {k}\n {op} 0x25, w" for op in ("subwf", "xorwf", "andwf") for k in (0, 1, 7, 30, 63)),
    *(f" movf 0x25, w\n {op} {k}" for op in ("sublw", "xorlw", "andlw") for k in (0, 1, 7, 30, 62)),
    *(f" movf 0x25, w\n addlw {-k & 0xFF}" for k in (0, 1, 7, 30, 63)),
    " movf 0x25, f", " movf 0x25, w", " movf 0x25, w\n movwf 0x26\n movwf 0x27",
]  # fmt: skip


@pytest.mark.parametrize("text", sampled(COMPARED, 5))
@pytest.mark.parametrize("flag", [0, 2])
def test_a_test_of_the_flag_leaves_the_members_for_which_the_chip_goes_there(text: str, flag: int) -> None:
    members = range(64)
    before = state_of({0x25: values.of(members), CARRY: 0, ZERO: 0, FSR: 0x4F})
    for name in ("BTFSS", "BTFSC"):
        program = [*words(text), encode(name, f=3, b=flag)]
        ends: dict[int, set[int]] = {}
        for member in members:
            chip = new_chip([*program, encode("NOP"), encode("NOP"), encode("NOP")])
            chip.ram[0x25 - 0x0C], chip.status = member, chip.status & ~7
            chip.run(len(program))
            ends.setdefault(chip.pc, set()).add(member)
        state = run(text, before)
        at = len(program) - 1
        tested, _ = execute(state, word_of(program[-1]), at)
        ways = {at + words_on: way for words_on, way in skip_ways(tested, state, word_of(program[-1]), at)}
        undecided = text.endswith("addlw 0")  # it never carries
        assert ways.keys() == ends.keys()
        for to, way in ways.items():
            assert set(way.get(0x25)) == (set(members) if undecided else ends[to])
            equal = {0x26, 0x27} if "0x27" in text else set()
            equal |= {W} if text.endswith(("w", "0x27")) and text.startswith(" movf") else set()
            for place in equal:
                assert set(way.get(place)) == ends[to]


def test_saving_a_register_uses_nothing_of_it() -> None:
    begun = at_interrupt(state_of({INTCON: 0xA0}))
    for text in (" movwf 0x40", " swapf STATUS, w", " movf FSR, w", " movf STATUS, w"):
        assert step(text, begun)[1].unwritten == set()
    assert step(" addwf 0x40, f", begun)[1].unwritten == {W, 0x40}
    assert step(" movf 0x40, w", begun)[1].unwritten == {0x40}


def two_states() -> tuple[AbstractState, AbstractState]:
    one = state_of({W: 1, 0x20: 5, 0x21: 7, 0x22: 1}, bits((W, 0x20, 0x21)))
    other = state_of({W: 1, 0x20: 6, 0x23: 8, 0x22: 1}, bits((0x20, 0x22)))
    one.saved, other.saved = {0x40: (W, True), 0x41: (FSR, False)}, {0x40: (W, True), 0x41: (FSR, True)}
    one.facts = {ZERO: (0x20, "==", 0), CARRY: (0x20, ">=", 3)}
    other.facts = {ZERO: (0x20, "==", 0), CARRY: (0x20, ">=", 4)}
    one.copies, other.copies = (0x22, 0x24), (0x24, 0x25)
    return one, other


def test_where_paths_meet_only_what_both_know_is_known() -> None:
    one, other = two_states()
    assert one.join(other)
    assert one.values == {
        BANK: values.constant(0), W: values.constant(1), 0x20: values.of({5, 6}), 0x22: values.constant(1)
    }  # fmt: skip
    assert one.written == bits((0x20,))
    assert one.saved == {0x40: (W, True)}
    assert one.facts == {ZERO: (0x20, "==", 0)}
    assert one.copies == (0x24,)
    again = one.copy()
    assert not one.join(other), "nothing is left to forget"
    assert not one.join(again)


@pytest.mark.parametrize("part", ["values", "missing", "written", "saved", "facts", "copies"])
def test_each_part_that_a_join_changes_is_reported(part: str) -> None:
    one, _ = two_states()
    other = one.copy()
    if part == "values":
        other.values[0x20] = values.constant(99)
    elif part == "missing":
        del other.values[0x20]
    elif part == "written":
        other.written &= ~bit(0x20)
    elif part == "copies":
        other.copies = (0x22,)
    else:
        getattr(other, part).clear()
    assert one.join(other)
    assert not one.join(other)


def test_a_value_that_grows_beyond_the_limit_becomes_any() -> None:
    def joined(mine: set[int], theirs: set[int], exempt: int = 0) -> set[int]:
        one = state_of({0x20: values.of(mine)})
        one.join(state_of({0x20: values.of(theirs)}), 3, exempt)
        return set(one.get(0x20))

    assert joined({1, 2}, {3}) == {1, 2, 3}
    assert joined({1, 2}, {3, 4}) == set(range(256))
    assert joined({1, 2, 3, 4}, {3, 4}) == {1, 2, 3, 4}, "it does not grow"
    assert joined({1, 2}, {3, 4}, exempt=bit(0x20)) == {1, 2, 3, 4}
    assert joined({1, 2}, {3, 4}, exempt=bit(0x21)) == set(range(256))
    whole = state_of({0x20: 1})
    whole.join(state_of({0x20: 2}))
    assert 0x20 in whole.values
    whole.values[0x20] = values.of_bits(0xFF, 0x7F)
    assert whole.join(state_of({0x20: 0x80}))
    assert 0x20 not in whole.values, "every value: one representation of it"


def test_up_to_1024_combinations_are_computed_and_more_are_not() -> None:
    word = word_of(encode("ADDWF", f=0x20, d=1))
    one, other = values.of(range(32)), values.of(range(0, 64, 2))
    result, changed = computed(word, one, other, BIT)
    assert set(result) == set(range(128)), "0 to 93, by the bits of more than 64 members"
    assert changed == {CARRY: values.constant(0), DIGIT: BIT, ZERO: BIT}
    more = values.of(range(0, 66, 2))
    assert computed(word, one, more, BIT) == (ANY, {CARRY: BIT, DIGIT: BIT, ZERO: BIT})
    rotate = word_of(encode("RLF", f=0x20, d=1))
    assert computed(rotate, ANY, values.of(range(4)), BIT)[0] is values.of(range(8))
    assert computed(word_of(encode("INCFSZ", f=0x20, d=1)), ANY, ANY, BIT)[1] == {}


def test_the_result_of_decfsz_at_a_register_that_keeps_five_bits_is_not_known_from_it() -> None:
    """DECFSZ PCLATH with PCLATH 0 makes 0xFF, of which five bits are kept: it does not skip."""
    before = state_of({PCLATH: 0})
    word = word_of(encode("DECFSZ", f=0x0A, d=1))
    state, _ = execute(before, word, 0)
    assert state.get(PCLATH).constant == 0x1F
    assert [words_on for words_on, _ in skip_ways(state, before, word, 0)] == [1, 2]


def test_a_tested_flag_of_an_interrupt_is_not_followed_but_its_enable_bit_is() -> None:
    before = state_of({INTCON: 0x20})
    for number, ways in ((5, [2]), (4, [1]), (3, [1]), (2, [1, 2]), (0, [1, 2])):
        word = word_of(encode("BTFSS", f=0x0B, b=number))
        assert sorted(to for to, _ in skip_ways(before.copy(), before, word, 0)) == ways
