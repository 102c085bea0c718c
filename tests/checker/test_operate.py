"""What an instruction does with unknown bits contains what it does with each value of them."""

from __future__ import annotations

import random

import numpy as np
from numba import njit

from servogen.checker import chip

UNARY = (chip.COM, chip.DEC, chip.INC, chip.MOV, chip.RLF, chip.RRF, chip.SWAP, chip.BCF, chip.BSF, chip.CLR)
BINARY = (chip.ADD, chip.SUB, chip.AND, chip.IOR, chip.XOR, chip.STORE)
FLAGS = 7
PHASED = 1 << 16


@njit
def concrete(cell, choice, phase):
    """The byte that a cell is when its unknown bits are those of `choice`."""
    return cell + phase & 0xFF if cell >> 16 else cell & 0xFF | choice & cell >> 8


@njit
def admits(cell, byte, phase):
    if cell >> 16:
        return cell + phase & 0xFF == byte
    return (cell ^ byte) & ~(cell >> 8) & 0xFF == 0


@njit
def escapes(op, a, w, status, bits, x, y, z, phase):
    """Whether the instruction leaves the result of unknown values when the values are these."""
    wide = chip.operate(op, a, w, status, bits, FLAGS)
    carry = concrete(status, z, 0)
    exact = chip.operate(op, concrete(a, x, phase), concrete(w, y, phase), carry, bits, FLAGS)
    result = admits(wide & 0x1FFFF, exact & 0xFF, phase)
    return exact >> 8 & 0xFFFF != 0 or not (result and admits(wide >> 24, exact >> 24 & 0xFF, 0))


@njit
def escaping_unary(op):
    """(operand, choice, status) that escapes, of all of them; -1 if none does."""
    for mask in range(256):
        for value in range(256):
            if value & mask:
                continue
            for status in (0, 1, 0x100, 0x706, 0x007):
                for choice in range(256):
                    if choice & ~mask:
                        continue
                    for z in range(2):
                        for bits in (1, 0x80):
                            if escapes(op, value | mask << 8, 0x1234 & 0xCB, status, bits, choice, 0, z, 0):
                                return value | mask << 8
    return -1


@njit
def escaping_binary(op, rows):
    for i in range(len(rows)):
        a, w, x, y, phase = rows[i]
        if escapes(op, a, w, 0x701, 1, x, y, x & 7, phase):
            return i
    return -1


def cells(rng: np.random.Generator, count: int) -> np.ndarray:
    """Cells: known, partly unknown with any number of bits, phased."""
    mask = rng.integers(0, 256, count) & rng.integers(0, 256, count) & -(rng.random(count) < 0.7).astype(int)
    value = rng.integers(0, 256, count) & ~mask
    return np.where(rng.random(count) < 0.25, value | PHASED, value | mask << 8)


def test_every_unary_instruction_on_every_unknown_byte_and_carry() -> None:
    assert [op for op in UNARY if escaping_unary(op) != -1] == []


def test_random_operands_of_which_any_are_unknown_or_move_with_the_phase() -> None:
    rng = np.random.default_rng(13)
    count = 200_000
    a, w = cells(rng, count), cells(rng, count)
    rows = np.stack([a, w, *(rng.integers(0, 256, count) for _ in range(3))], axis=1)
    for op in (*BINARY, *UNARY):
        found = escaping_binary(op, rows)
        assert found == -1, (chip.OPERATIONS[op], [hex(each) for each in rows[found]])


def test_what_is_known_of_bytes_that_move_together() -> None:
    """The difference of two such bytes is known, and whether they are equal; nothing else of them."""
    for base in random.Random(1).sample(range(256), 20):
        for other in (base, 0, 77):
            a, w = base | PHASED, other | PHASED
            difference = chip.operate(chip.SUB, a, w, 0, 1, FLAGS)
            assert difference & 0x1FFFF == (base - other) & 0xFF
            assert difference >> 32 & 7 == chip.C | chip.DC
            xor = chip.operate(chip.XOR, a, w, 0, 1, FLAGS)
            assert xor >> 24 & 0xFFFF == (chip.Z if base == other else 0)
            assert chip.operate(chip.ADD, a, w, 0, 1, FLAGS) >> 8 & 0xFF == 0xFF
    for op, result in ((chip.ADD, 0x29), (chip.SUB, 0x1F)):
        assert chip.operate(op, 0x24 | PHASED, 5, 0, 1, FLAGS) & 0x1FFFF == result | PHASED
    assert chip.operate(chip.SUB, 5, 0x24 | PHASED, 0, 1, FLAGS) & 0x1FFFF == 0xFF00


def test_additions_know_every_bit_that_no_carry_reaches() -> None:
    """By hand: 8 or 12, plus 4, is 12 or 16: bits 0, 1 and 5 to 7 are known, and the carry."""
    added = chip.operate(chip.ADD, 0x08 | 0x04 << 8, 0x04, 0, 1, FLAGS)
    assert (added & 0xFF, added >> 8 & 0xFF) == (0x00, 0x1C)
    assert added >> 32 & 7 == chip.DC | chip.Z  # that neither is 0 is not in the bits


def test_ra4_is_known_where_the_program_pulls_it_low_or_the_board_holds_it() -> None:
    """An open drain: of an output at 1 the wire says what it is, of every other pin the latch."""
    state, parameters = np.zeros(chip.SLOTS + 1, np.int64), np.zeros(8, np.int64)

    def read(latch: int) -> int:
        state[chip.PORTA] = latch
        return chip.read.py_func(state, parameters, chip.PORTA, 0)

    assert read(0x01) == 0x01
    assert read(0x11) == 0x01 | 0x10 << 8  # unknown
    parameters[chip.CHANNELS] = 0x10  # a servo's pin has the pull-up that the job asks for
    assert read(0x11) == 0x11
    parameters[chip.CHANNELS], parameters[chip.HELD] = 0, 0x10
    assert read(0x11) == 0x01
    parameters[chip.LEVELS] = 0x10
    assert read(0x11) == 0x11
