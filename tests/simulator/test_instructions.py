"""Each instruction: program counter, cycles, W, STATUS and destination together (DS35007 section 7, table
7-2).

The arithmetic ones run over every pair of operands, and with C at 0 and at 1, against the table of
`pic.semantics`, which tests/pic/test_semantics.py compares with adders.
"""

from __future__ import annotations

import numpy as np
import pytest

from servogen.pic.isa import INSTRUCTIONS, encode
from servogen.simulator import Machine, Observation
from servogen.units import Clock
from tests.campaigns import sampled
from tests.pic.test_semantics import tabled
from tests.simulator.flags import BYTE_ORIENTED, LITERAL, Bytes
from tests.simulator.helpers import image, machine, ram, steps

CLOCK = Clock(4_000_000)
SKIPS = ("DECFSZ", "INCFSZ")
CYCLE, PC, W, STATUS = range(4)

FILE_LOOP = """
        clrf    0x20            ; f
        clrf    0x21            ; w
loop    movf    0x20, w
        movwf   0x22
        movf    0x21, w
        {carry} STATUS, C
        {name}  0x22, {d}
        nop
        movf    0x22, w
        incfsz  0x21, f
        goto    loop
        incfsz  0x20, f
        goto    loop
        goto    $
"""
OP_AT = 6
FILE_CYCLES = 65536 * 13


def traced(chip: Machine, cycles: int) -> Bytes:
    """(cycle, PC, W after, STATUS after) of every instruction."""
    observation = Observation(trace=np.zeros((1 << 20, 4), dtype=np.int64))
    return np.concatenate([rows for _, rows in chip.observe(cycles, observation)])


def computed(name: str, operand: Bytes, w: Bytes, status: Bytes) -> tuple[Bytes, Bytes]:
    """The result and STATUS afterwards, by the table of `pic.semantics`."""
    made, flags = tabled(name, operand, w, status & 7, 0)
    return made, status & ~7 | flags


def file_cases() -> list[tuple[str, int, int]]:
    return [(name, d, c) for name in BYTE_ORIENTED for d in (0, 1) for c in (0, 1)]


@pytest.mark.parametrize(("name", "d", "c"), sampled(file_cases(), 14))
def test_byte_oriented_instructions_agree_with_the_adders_for_all_operands(name: str, d: int, c: int) -> None:
    chip = machine(FILE_LOOP.format(name=name, d=d, carry=("bcf", "bsf")[c]))
    rows = traced(chip, FILE_CYCLES)
    at = np.flatnonzero(rows[:, PC] == OP_AT)[:65536]
    f, w = np.divmod(np.arange(65536), 256)
    before, op, read_back = rows[at - 1], rows[at], rows[np.flatnonzero(rows[:, PC] == OP_AT + 2)[:65536]]
    made, status = computed(name, f, w, before[:, STATUS])
    assert (before[:, STATUS] & 1 == c).all()
    skipped = (made == 0) if name in SKIPS else np.zeros(65536, dtype=bool)
    assert np.array_equal(op[:, W], w if d else made)
    assert np.array_equal(op[:, STATUS], status)
    assert np.array_equal(read_back[:, W], made if d else f)
    assert np.array_equal(rows[at + 1][:, PC], OP_AT + 1 + skipped)
    assert np.array_equal(rows[at + 1][:, CYCLE] - op[:, CYCLE], 1 + skipped)


@pytest.mark.parametrize("name", LITERAL)
def test_literal_instructions_agree_with_the_adders_for_all_operands(name: str) -> None:
    for half in (0, 128):
        loop = "".join(f"        movf 0x20, w\n        {name} {k}\n" for k in range(half, half + 128))
        chip = machine(
            f"        clrf 0x20\nloop\n{loop}        incfsz 0x20, f\n        goto loop\n        goto $\n"
        )
        rows = traced(chip, 256 * 259)
        at = np.flatnonzero((rows[:, PC] >= 1) & (rows[:, PC] < 257) & (rows[:, PC] % 2 == 0))[: 256 * 128]
        k = np.tile(np.arange(half, half + 128), 256)
        w = np.repeat(np.arange(256), 128)
        made, status = computed(name, k, w, rows[at - 1, STATUS])
        assert np.array_equal(rows[at, W], made)
        assert np.array_equal(rows[at, STATUS], status)
        assert np.array_equal(rows[at + 1, PC], rows[at, PC] + 1)
        assert np.array_equal(rows[at + 1, CYCLE], rows[at, CYCLE] + 1)


BIT_LOOP = """
        clrf    0x20
        movlw   0x5A
loop    movf    0x20, w
        movwf   0x22
        {name}  0x22, {bit}
        nop
        movf    0x22, w
        incfsz  0x20, f
        goto    loop
        goto    $
"""


@pytest.mark.parametrize("bit", range(8))
@pytest.mark.parametrize(("name", "on"), [("BCF", 0), ("BSF", 1)])
def test_bit_set_and_clear_change_one_bit_and_no_flag(name: str, on: int, bit: int) -> None:
    rows = traced(machine(BIT_LOOP.format(name=name, bit=bit)), 256 * 8)
    at = np.flatnonzero(rows[:, PC] == 4)[:256]
    f = np.arange(256)
    assert np.array_equal(rows[at + 2, W], f | 1 << bit if on else f & ~(1 << bit))
    assert np.array_equal(rows[at, W], f)
    assert np.array_equal(rows[at, STATUS], rows[at - 1, STATUS])
    assert np.array_equal(rows[at + 1, PC], np.full(256, 5))
    assert np.array_equal(rows[at + 1, CYCLE], rows[at, CYCLE] + 1)


@pytest.mark.parametrize(("name", "skips_on"), [("BTFSC", 0), ("BTFSS", 1)])
def test_bit_tests_skip_in_two_cycles_and_go_on_in_one(name: str, skips_on: int) -> None:
    for value in (0x00, 0xFF, 0x01, 0x80, 0xA5):
        for bit in range(8):
            chip = steps(machine(f" movlw {value}\n movwf 0x20\n {name} 0x20, {bit}\n"), 3)
            skips = (value >> bit & 1) == skips_on
            state = chip.state()
            assert (state.pc, state.cycles, state.w) == ((4, 4, value) if skips else (3, 3, value))
            assert ram(chip, 0x20) == value


def test_clears_set_z_and_nothing_else() -> None:
    chip = steps(machine(" movlw 0xE3\n movwf STATUS\n movlw 7\n clrw\n"), 3)
    before = chip.state().status
    state = steps(chip, 1).state()
    assert (state.pc, state.cycles, state.w, state.status) == (4, 4, 0, before | 4)
    chip = steps(machine(" movlw 7\n movwf 0x20\n clrf 0x20\n"), 3)
    state = chip.state()
    assert (state.pc, state.cycles, state.w, state.status & 7, ram(chip, 0x20)) == (3, 3, 7, 4, 0)


def test_movwf_stores_w_and_touches_no_flag() -> None:
    chip = steps(machine(" movlw 0\n movwf 0x20\n"), 2)
    state = chip.state()
    assert (state.pc, state.cycles, state.w, state.status, ram(chip, 0x20)) == (2, 2, 0, 0x18, 0)
    assert state.ram_written == (0x20,)


def test_nop_does_nothing_in_one_cycle() -> None:
    state = steps(machine(" nop\n"), 1).state()
    assert (state.pc, state.cycles, state.w, state.status) == (1, 1, 0, 0x18)


def test_goto_and_call_take_two_cycles_and_call_pushes_the_next_address() -> None:
    state = steps(machine(" goto 0x123\n"), 1).state()
    assert (state.pc, state.cycles, state.stack_depth) == (0x123, 2, 0)
    state = steps(machine(" call 0x123\n"), 1).state()
    assert (state.pc, state.cycles, state.stack_depth, state.stack[0]) == (0x123, 2, 1, 1)


@pytest.mark.parametrize(
    ("name", "w", "gie"), [("return", 5, 0), ("retlw 0x77", 0x77, 0), ("retfie", 5, 0x80)]
)
def test_returns_take_two_cycles(name: str, w: int, gie: int) -> None:
    chip = steps(machine(f" movlw 5\n call sub\n nop\nsub {name}\n"), 3)
    state = chip.state()
    assert (state.pc, state.cycles, state.w, state.status, state.stack_depth) == (2, 5, w, 0x18, 0)
    assert state.registers["INTCON"] == gie


def test_clrwdt_and_sleep_set_to_and_pd() -> None:
    chip = steps(machine(" clrwdt\n sleep\n"), 1)
    assert (chip.state().pc, chip.state().cycles, chip.state().status & 0x18) == (1, 1, 0x18)
    state = steps(chip, 1).state()
    assert (state.pc, state.cycles, state.status & 0x18, state.sleeping) == (2, 2, 0x10, True)


def test_option_and_tris_write_w() -> None:
    words = [encode("MOVLW", k=0x35), encode("OPTION"), encode("TRIS", f=5), encode("TRIS", f=6)]
    blank = image(" nop\n")
    chip = steps(machine(type(blank)(dict(enumerate(words)), blank.config)), 4)
    registers = chip.state().registers
    assert (chip.state().cycles, registers["OPTION_REG"], registers["TRISA"], registers["TRISB"]) == (
        4,
        0x35,
        0x15,
        0x35,
    )


def test_every_instruction_of_the_data_sheet_has_a_test_here() -> None:
    others = {
        "BCF", "BSF", "BTFSC", "BTFSS", "CLRF", "CLRW", "MOVWF", "NOP", "CALL", "GOTO", "RETURN", "RETLW",
    }  # fmt: skip
    others |= {"RETFIE", "CLRWDT", "SLEEP"}
    assert {row.mnemonic for row in INSTRUCTIONS} == set(BYTE_ORIENTED) | set(LITERAL) | others


def test_encodings_that_differ_in_ignored_bits_do_the_same() -> None:
    """NOP, CLRW, MOVLW, RETLW, SUBLW and ADDLW have bits that the chip ignores: DS35007 table 7-2."""
    for word, same in (
        (0x0020, 0x0000),
        (0x0060, 0x0000),
        (0x017F, 0x0100),
        (0x3355, 0x3055),
        (0x3F55, 0x3E55),
    ):
        assert run_word(word) == run_word(same)
    for word, same in ((0x3D55, 0x3C55), (0x3755, 0x3455)):
        assert run_word(word) == run_word(same)


def run_word(word: int) -> tuple[int, int, int, int]:
    blank = image(" nop\n")
    program = {0: encode("MOVLW", k=0x0F), 1: encode("CALL", k=2), 2: word}
    state = steps(machine(type(blank)(program, blank.config)), 3).state()
    return state.pc, int(state.cycles), state.w, state.status
