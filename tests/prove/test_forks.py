"""Which instructions read pins, registers and the EEPROM, and which cases an unknown bit makes of a state."""

from __future__ import annotations

from typing import Any

import pytest

from servogen.pic.device import RAM_FIRST
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove.chip import CELL_PHASED, FIELD, FIELDS, WRITTEN, AssumedBits, ChipState, Use
from servogen.prove.forks import ALONE, MAX_CHOICES, Choices, PreparedProgram, before_instruction, ways_of
from servogen.simulator import layout

STATUS, FSR, PORTA, PORTB, EEDATA, EEADR, INTCON = 3, 4, 5, 6, 8, 9, 11
INDF, TMR0 = 0, 1
RAM = 0x0C
RP0 = 0x20

OF_FILE_AND_D = (
    "ADDWF", "ANDWF", "COMF", "DECF", "DECFSZ", "INCF", "INCFSZ", "IORWF", "MOVF", "RLF", "RRF", "SUBWF",
    "SWAPF", "XORWF",
)  # fmt: skip
OF_BIT = ("BCF", "BSF", "BTFSC", "BTFSS")


def program(*words: int) -> PreparedProgram:
    return PreparedProgram(Image(dict(enumerate(words))))


def of_register(f: int) -> dict[str, int]:
    """Every instruction of a register: DS35007 table 7-2."""
    words = {f"{name} {d}": encode(name, f=f, d=d) for name in OF_FILE_AND_D for d in (0, 1)}
    words |= {name: encode(name, f=f, b=b) for name in OF_BIT for b in (0,)}
    return words | {"MOVWF": encode("MOVWF", f=f), "CLRF": encode("CLRF", f=f)}


READING_ONLY = {*(f"{name} 0" for name in OF_FILE_AND_D), "BTFSC", "BTFSS"}
WRITING = {*(f"{name} 1" for name in OF_FILE_AND_D), "BCF", "BSF", "MOVWF", "CLRF"}


@pytest.mark.parametrize("port", [PORTA, PORTB])
def test_reads_of_a_port_are_those_that_do_not_write_it(port: int) -> None:
    for name, word in of_register(port).items():
        assert (program(word).port_reads() == {0}) == (name in READING_ONLY), name
    for f in (INDF, TMR0, STATUS, FSR, 7, EEDATA, RAM):
        assert not program(*of_register(f).values()).port_reads()
    # A literal that happens to be a port's address.
    assert not program(encode("MOVLW", k=port), encode("GOTO", k=port)).port_reads()


def test_option_is_written_by_its_instruction_and_through_its_address() -> None:
    for name, word in of_register(TMR0).items():
        assert (program(word).option_writes() == {0}) == (name in WRITING), name
    assert program(encode("OPTION")).option_writes() == {0}
    for f in (INDF, STATUS, PORTA, RAM):
        assert not program(*of_register(f).values()).option_writes()
    assert not program(encode("MOVLW", k=1), encode("NOP")).option_writes()


def test_accesses_are_by_name_or_only_those_that_write() -> None:
    for name, word in of_register(EEDATA).items():
        assert program(word).accesses(EEDATA) == {0}
        assert (program(word).accesses(EEDATA, writing=True) == {0}) == (name in WRITING), name
        assert not program(word).accesses(EEADR)
    assert not program(encode("MOVLW", k=EEDATA), encode("TRIS", f=5)).accesses(EEDATA)


def test_the_eeprom_matters_if_a_word_may_start_a_write() -> None:
    through = encode("MOVF", f=INDF, d=0)
    for name, word in of_register(EEDATA).items():
        bit_0 = name in ("BCF", "BSF")  # the bits of `of_register` are bit 0, RD
        expected = frozenset() if bit_0 or name not in WRITING else {0, 1}
        assert program(word, through).eeprom_accesses == expected, name
    for name, b, expected in (
        ("BSF", 1, {0, 1}),
        ("BCF", 1, frozenset()),
        ("BSF", 2, frozenset()),
        ("BTFSS", 1, frozenset()),
    ):
        assert program(encode(name, f=EEDATA, b=b), through).eeprom_accesses == expected, name
    assert program(through).eeprom_accesses == frozenset()


def test_sleeps_and_entries() -> None:
    one = program(encode("CALL", k=7), encode("SLEEP"), encode("GOTO", k=3), encode("CALL", k=0x3FF))
    assert one.sleeps == {1}
    assert one.entries == {7, 1, 0x3FF, 4}
    last = PreparedProgram(Image({0x3FF: encode("CALL", k=5)}))
    assert last.entries == {0, 5}, "the address after the last one is 0"


def test_an_address_is_taken_modulo_the_program_memory() -> None:
    one = PreparedProgram(Image({1: encode("NOP"), 2: 0x0002}))
    assert one.at(0x401) is not None and one.at(0) is None
    assert one.at(2) is None, "a word that no data sheet defines"


# states


def state(ram: dict[int, int] | None = None, **fields: int) -> ChipState:
    cells = [0] * 68
    for address, cell in (ram or {}).items():
        cells[address - RAM_FIRST] = cell
    rest = [0] * len(FIELDS)
    for name, value in ({"EE_DONE_AT": layout.NEVER} | fields).items():
        rest[FIELD[name]] = value
    return ChipState(tuple(cells), tuple(rest))


def before(word: int, sampled: frozenset[int] = frozenset(), phases: int = 4, **fields: int) -> list[Choices]:
    return before_instruction(program(word), state(**fields), sampled, phases)


def test_most_instructions_have_one_way() -> None:
    for word in (*of_register(RAM).values(), *of_register(TMR0).values(), *of_register(STATUS).values()):
        assert before(word) == [()]
    for word in (encode("NOP"), encode("MOVLW", k=5), encode("GOTO", k=6), encode("RETURN")):
        assert before(word, PINS_UNKNOWN=0x1FFF) == [()]
    assert before_instruction(PreparedProgram(Image({})), state(), frozenset(), 4) == [()]


def test_sleep_is_executed_alone() -> None:
    assert before(encode("SLEEP")) == [(ALONE,)]
    assert AssumedBits("INTCON", 0, 0) == ALONE


@pytest.mark.parametrize("phases", [1, 4])
def test_a_write_of_option_has_a_way_for_each_phase(phases: int) -> None:
    ways = [(AssumedBits("TMR0_PHASE", 0, phase),) for phase in range(phases)]
    assert before(encode("OPTION"), phases=phases) == ways
    for name, word in of_register(TMR0).items():
        assert before(word, phases=phases, STATUS=RP0) == (ways if name in WRITING else [()]), name
        assert before(word, phases=phases) == [()], "in bank 0 it is TMR0"


def test_eecon1_reads_differently_once_a_write_is_over() -> None:
    both = [(ALONE,), (AssumedBits("EE_DONE", 0, 0),)]
    for word in of_register(EEDATA).values():
        assert before(word, STATUS=RP0) == [(ALONE,)]
        assert before(word, STATUS=RP0, EE_DONE_AT=7) == both
        assert before(word) == [()] == before(word, EE_DONE_AT=7), "in bank 0 it is EEDATA"
        fixed = PreparedProgram(Image({0: word}), any_write_time=False)
        assert before_instruction(fixed, state(STATUS=RP0, EE_DONE_AT=7), frozenset(), 4) == [(ALONE,)]
    through = encode("MOVF", f=INDF, d=0)
    assert before(through, FSR=0x88) == [(ALONE,)]
    assert before(through, FSR=0x08) == [()] == before(through, FSR=0x89)
    assert before(through, FSR=0x30, FSR_UNKNOWN=1) == [(ALONE,)], "it may be"
    assert before(through, STATUS=RP0, FSR=0x0C) == [()]


RA, RB = 0x001F, 0x1FE0


def pin_ways(*pins: int) -> set[frozenset[tuple[int, int]]]:
    """All combinations of levels."""
    ways: set[frozenset[tuple[int, int]]] = {frozenset()}
    for pin in pins:
        ways = {way | {(1 << pin, level << pin)} for way in ways for level in (0, 1)}
    return ways


def as_pins(ways: list[Choices]) -> set[frozenset[tuple[int, int]]]:
    assert all(choice.field == "PINS" and not choice.steer for way in ways for choice in way)
    return {frozenset((choice.bits, choice.value) for choice in way) for way in ways}


def test_a_tested_pin_that_is_unknown_goes_both_ways() -> None:
    for f, first in ((PORTA, 0), (PORTB, 5)):
        for b in range(5 if f == PORTA else 8):
            for name in ("BTFSC", "BTFSS"):
                word = encode(name, f=f, b=b)
                assert as_pins(before(word, PINS_UNKNOWN=RA | RB)) == pin_ways(first + b)
                assert before(word, PINS_UNKNOWN=(RA | RB) & ~(1 << first + b)) == [()]
                assert before(word, PINS_UNKNOWN=RA | RB, STATUS=RP0) == [()], "in bank 1 it is TRIS"


def test_a_port_that_is_read_shows_its_buttons() -> None:
    sampled = frozenset({0, 4, 5, 12})
    for word in (encode("MOVF", f=PORTA, d=0), encode("SWAPF", f=PORTA, d=0)):
        assert as_pins(before(word, sampled, PINS_UNKNOWN=RA | RB)) == pin_ways(0, 4)
        assert as_pins(before(word, sampled, PINS_UNKNOWN=1 << 4)) == pin_ways(4)
        assert before(word, PINS_UNKNOWN=RA | RB) == [()], "other pins decide later, if they do"
    word = encode("MOVF", f=PORTB, d=0)
    assert as_pins(before(word, sampled, PINS_UNKNOWN=RA | RB)) == pin_ways(5, 12)
    for name, word in of_register(PORTB).items():
        if name in WRITING:
            assert before(word, sampled, PINS_UNKNOWN=RA | RB) == [()], name


# ways of a bit that decides


def ways(
    word: int | None, kind: int, chosen: Choices = (), *, subject: int = 0, ram: Any = None, **fields: int
) -> list[Choices] | None:
    one = PreparedProgram(Image({} if word is None else {0: word}))
    return ways_of(one, state(ram=ram, **fields), Use(kind, subject, 0), chosen)


def single(field: str, bit: int, chosen: Choices = ()) -> list[Choices]:
    return [(*chosen, AssumedBits(field, bit, value)) for value in (0, bit)]


def test_one_unknown_bit_is_chosen_at_a_time_the_lowest_first() -> None:
    add = encode("ADDWF", f=RAM, d=0)
    cell = {RAM: 0b1010_0000 << 8}
    assert ways(add, layout.USE_JUMP, ram=cell) == single("0x0C", 0x20)
    chosen = (AssumedBits("0x0C", 0x20, 0),)
    assert ways(add, layout.USE_JUMP, chosen, ram=cell) == single("0x0C", 0x80, chosen)
    both = (*chosen, AssumedBits("0x0C", 0x80, 0x80))
    # Its other operand is W.
    assert ways(add, layout.USE_JUMP, both, ram=cell, W_UNKNOWN=2) == single("W", 2, both)
    assert ways(add, layout.USE_JUMP, both, ram=cell) is None
    assert ways(add, layout.USE_JUMP, ram={RAM: CELL_PHASED | 7}) == single("0x0C", 1)
    assert ways(encode("RLF", f=RAM, d=0), layout.USE_JUMP, STATUS_UNKNOWN=4) == single("STATUS", 4)
    assert ways(encode("MOVF", f=RAM, d=0), layout.USE_JUMP, W_UNKNOWN=2) is None, "W is not read"
    assert ways(None, layout.USE_JUMP, W_UNKNOWN=2) is None


def test_a_tested_bit_is_the_only_one_that_decides() -> None:
    for b in range(8):
        word = encode("BTFSS", f=RAM, b=b)
        assert ways(word, layout.USE_SKIP, ram={RAM: 0xFF00}) == single("0x0C", 1 << b)
        assert ways(word, layout.USE_SKIP, ram={RAM: 0xFF00 & ~(1 << 8 + b)}) is None
    for b in range(8):
        word = encode("BTFSC", f=PORTB, b=b)
        assert ways(word, layout.USE_SKIP, PINS_UNKNOWN=RA | RB) == single("PINS", 1 << 5 + b)
    assert ways(encode("BTFSC", f=PORTA, b=4), layout.USE_SKIP, PINS_UNKNOWN=RA | RB) == single("PINS", 16)


def test_a_counter_is_its_last_value_or_another_one() -> None:
    for name, last in (("DECFSZ", 1), ("INCFSZ", 0xFF)):
        word = encode(name, f=RAM, d=1)
        for mask in (0xFF, 0xF0, 0x01, 0x80):
            found = ways(word, layout.USE_SKIP, ram={RAM: mask << 8})
            assert found is not None
            (one,), (other,) = found
            assert one == AssumedBits("0x0C", 0xFF, last)
            assert (other.field, other.bits, other.steer) == ("0x0C", 0xFF, True)
            # Any other value that the unknown bits allow.
            assert other.value != last and other.value ^ last == mask & -mask
        found = ways(word, layout.USE_SKIP, ram={RAM: CELL_PHASED})
        assert found is not None and found[1][0].value == last ^ 1


@pytest.mark.parametrize(
    ("f", "fields", "field"),
    [
        (PORTA, {"PINS_UNKNOWN": 1}, "PINS"),
        (PORTA, {"STATUS": RP0, "PINS_UNKNOWN": 1}, None),
        (FSR, {"FSR_UNKNOWN": 1}, "FSR"),
        (FSR, {"FSR_UNKNOWN": 1, "STATUS": RP0}, "FSR"),
        (STATUS, {"STATUS_UNKNOWN": 1}, "STATUS"),
        (EEDATA, {"EEDATA_UNKNOWN": 1}, "EEDATA"),
        (EEADR, {"EEADR_UNKNOWN": 1}, "EEADR"),
        (EEDATA, {"EEDATA_UNKNOWN": 1, "STATUS": RP0}, None),
        (INTCON, {"INTCON_UNKNOWN": 1, "STATUS": RP0}, "INTCON"),
        (INDF, {"FSR": 0x04, "FSR_UNKNOWN": 0}, None),
        (INDF, {"FSR": 0x08, "EEDATA_UNKNOWN": 1}, "EEDATA"),
        (INDF, {"FSR": 0x88, "EEDATA_UNKNOWN": 1}, None),
        (INDF, {"FSR": 0x05, "PINS_UNKNOWN": 1}, "PINS"),
        (INDF, {"FSR": 0x05, "STATUS": RP0, "PINS_UNKNOWN": 1}, "PINS"),
        (INDF, {"FSR": 0x84, "FSR_UNKNOWN": 1}, None),
    ],
)
def test_a_register_s_own_bits_decide(f: int, fields: dict[str, int], field: str | None) -> None:
    found = ways(encode("MOVF", f=f, d=0), layout.USE_JUMP, **fields)
    assert found == (None if field is None else single(field, 1))


def test_the_ends_of_the_ram_are_bytes_of_it() -> None:
    for address in (0x0C, 0x4F):
        for f, fields in ((address, {}), (INDF, {"FSR": address})):
            found = ways(encode("MOVF", f=f, d=0), layout.USE_JUMP, ram={address: 0x100}, **fields)
            assert found == single(f"0x{address:02X}", 1)
    assert ways(encode("MOVF", f=0x50, d=0), layout.USE_JUMP) is None


def test_a_pointer_is_split_at_fsr() -> None:
    word = encode("MOVF", f=INDF, d=0)
    assert ways(word, layout.USE_POINTER, FSR_UNKNOWN=0x06) == single("FSR", 2)
    assert ways(word, layout.USE_POINTER) is None


def test_the_bits_of_one_instruction_are_limited() -> None:
    word = encode("MOVF", f=RAM, d=0)
    chosen = tuple(AssumedBits("W", 1, 0) for _ in range(MAX_CHOICES))
    assert ways(word, layout.USE_JUMP, chosen, ram={RAM: 0x100}) is None
    assert ways(word, layout.USE_JUMP, chosen[1:], ram={RAM: 0x100}) is not None


def test_an_interrupt_has_a_way_without_any_flag_and_two_for_each() -> None:
    T0IF, INTF, RBIF = 4, 2, 1
    none = AssumedBits("INTCON", INTF | RBIF, 0)
    flags = [AssumedBits(field, flag, flag) for flag in (RBIF, INTF) for field in ("INTCON", "INTCON_LATE")]
    found = ways(None, layout.USE_INTERRUPT, subject=INTF | RBIF)
    assert found == [(event,) for event in (none, *flags)]
    written = [AssumedBits("EE_DONE", 0, late) for late in (0, 1)]
    assert WRITTEN == 8
    found = ways(None, layout.USE_INTERRUPT, (ALONE,), subject=WRITTEN)
    assert found == [(ALONE, event) for event in (AssumedBits("INTCON", 0, 0), *written)]
    timer = [AssumedBits("INTCON", T0IF, 0), *(AssumedBits(f, T0IF, T0IF) for f in ("INTCON", "INTCON_LATE"))]
    assert ways(None, layout.USE_INTERRUPT, subject=T0IF) == [(event,) for event in timer]
    assert ways(None, layout.USE_INTERRUPT, subject=T0IF, TMR0_UNKNOWN=1) is None
    assert ways(None, layout.USE_INTERRUPT, subject=INTF, TMR0_UNKNOWN=1) is not None


def test_waking_has_a_way_without_any_flag_and_one_for_each() -> None:
    word = encode("SLEEP")
    found = ways(word, layout.USE_WAKE, subject=3)
    assert found == [(AssumedBits("INTCON", 3, value),) for value in (0, 1, 2)]
    assert ways(word, layout.USE_WAKE, subject=4) == [(AssumedBits("INTCON", 4, value),) for value in (0, 4)]


def test_a_read_of_the_eeprom_begins_where_rd_may_be_set() -> None:
    def reads(word: int, **fields: int) -> bool:
        return program(word).reads_eeprom(state(**fields))

    bank_1 = {"STATUS": RP0}
    for b in range(8):
        assert reads(encode("BSF", f=EEDATA, b=b), **bank_1) == (b == 0)
        assert not reads(encode("BCF", f=EEDATA, b=b), **bank_1)
        assert not reads(encode("BTFSS", f=EEDATA, b=b), **bank_1)
    assert not reads(encode("BSF", f=EEDATA, b=0)), "in bank 0 it is EEDATA"
    move = encode("MOVWF", f=EEDATA)
    assert reads(move, **bank_1, W=1) and not reads(move, **bank_1, W=0xFE)
    assert reads(move, **bank_1, W=0, W_UNKNOWN=1) and not reads(move, **bank_1, W=0, W_UNKNOWN=0xFE)
    for name, word in of_register(EEDATA).items():
        if name not in ("MOVWF", "BSF", "BCF"):
            assert reads(word, **bank_1) == (name in WRITING), name
    assert reads(encode("BSF", f=INDF, b=0), FSR=0x88) and not reads(encode("BSF", f=INDF, b=0), FSR=0x08)
    assert reads(encode("BSF", f=INDF, b=0), FSR_UNKNOWN=1)
    assert not PreparedProgram(Image({})).reads_eeprom(state())
