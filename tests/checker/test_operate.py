"""What instructions do with unknown bits, and with bytes that move with TMR0's phase."""

from __future__ import annotations

import itertools
import random

import numpy as np

from servogen.checker import chip, layout
from tests.checker import functions
from tests.checker.each import result_table
from tests.checker.lockstep import board

OPERATIONS = list(layout.OPERATIONS)
MOVES = 1 << 16


def operate(name: str, a: int, x: int) -> tuple[int, int, int]:
    """The cell, the flags and the unknown flags."""
    memo = np.full((layout.MEMO, 2), -1)
    found = functions.operate(memo, OPERATIONS.index(name), a, x)
    assert functions.operate(memo, OPERATIONS.index(name), a, x) == found  # remembered
    return found & 0x1FFFF, found >> 24 & 7, found >> 32 & 7


def values(cell: int, phase: int) -> list[int]:
    """All bytes that a cell may be."""
    if cell & MOVES:
        return [cell + phase & 0xFF]
    mask = cell >> 8
    return sorted({cell & 0xFF | choice & mask for choice in range(256)})


def cells(rng: random.Random) -> int:
    """A cell: known, with some unknown bits, or moving."""
    kind, value, mask = rng.randrange(4), rng.randrange(256), rng.randrange(256) & rng.randrange(256)
    return value | MOVES if kind == 0 else value if kind == 1 else value & ~mask | mask << 8


def test_the_result_is_what_all_choices_have_in_common() -> None:
    """It contains each choice, by a loop of its own; and what it knows could not be more."""
    rng = random.Random(13)
    for name in OPERATIONS:
        for _ in range(6):
            a, x = cells(rng), cells(rng)
            cell, flags, doubt = operate(name, a, x)
            every, some = 0x7FF, 0
            for phase in range(256) if (a | x) & MOVES else [0]:
                for one, other in itertools.product(values(a, phase), values(x, phase)):
                    exact, its_flags, none = operate_known(name, one, other)
                    assert none == 0
                    assert exact in values(cell, phase), (name, hex(a), hex(x))
                    every, some = every & (exact | its_flags << 8), some | exact | its_flags << 8
            assert (flags, doubt) == (every >> 8, (every ^ some) >> 8)
            assert cell & MOVES or cell == every & 0xFF | (every ^ some) << 8 & 0xFF00


def operate_known(name: str, a: int, x: int) -> tuple[int, int, int]:
    word = int(result_table()[OPERATIONS.index(name), x, a])
    return word & 0xFF, word >> 8, 0


def test_what_is_known_of_bytes_that_move_together() -> None:
    """The difference of two such bytes is known, and whether they are equal; nothing else of them."""
    for base in random.Random(1).sample(range(256), 20):
        for other in (base, 0, 77):
            difference, _, doubt = operate("SUB", base | MOVES, other | MOVES)
            assert difference == (base - other) & 0xFF
            assert doubt & layout.Z == 0
            _, flags, doubt = operate("XOR", base | MOVES, other | MOVES)
            assert flags & layout.Z == (layout.Z if base == other else 0)
            assert doubt & layout.Z == 0
    assert operate("ADD", 0x24 | MOVES, 5)[0] == 0x29 | MOVES
    assert operate("SUB", 0x24 | MOVES, 5)[0] == 0x1F | MOVES
    assert operate("SUB", 5, 0x24 | MOVES)[0] == 0xFF00


def test_additions_know_every_bit_that_no_carry_reaches() -> None:
    """By hand: 8 or 12, plus 4, is 12 or 16: bits 0, 1 and 5 to 7 are known, and that neither is 0."""
    cell, _, doubt = operate("ADD", 0x08 | 0x04 << 8, 0x04)
    assert (cell & 0xFF, cell >> 8) == (0x00, 0x1C)
    assert doubt == layout.DC


def test_ra4_is_known_where_the_program_pulls_it_low_or_the_board_holds_it() -> None:
    """An open drain: of an output at 1 the wire says what it is, of every other pin the latch."""

    def read(latch: int, around: layout.ChipSurroundings) -> int:
        state = np.zeros(layout.SLOTS, np.int64)
        state[layout.PORTA] = latch
        return functions.read(state, around, layout.PORTA)

    free = board(1)
    assert read(0x01, free) == 0x01
    assert read(0x11, free) == 0x01 | 0x10 << 8  # unknown
    assert read(0x11, free._replace(channels=0x10)) == 0x11  # a servo's pin has the job's pull-up
    assert read(0x11, free._replace(held=0x10)) == 0x01
    assert read(0x11, free._replace(held=0x10, levels=0x10)) == 0x11


def written(slot: int, cell: int, option: int = 0) -> tuple[int, chip.Ints]:
    """Write a cell to a register. Returns the reason to stop, and the chip afterwards."""
    state = np.zeros(layout.SLOTS, np.int64)
    state[layout.OPTION] = option
    return functions.write(state, np.zeros(66, np.int64), board(1), slot, cell), state


def after(state: chip.Ints, cycles: int) -> int:
    """Return TMR0 so many cycles after the instruction that wrote it."""
    later = state.copy()
    functions.tick(later, cycles)
    return int(later[layout.TMR0])


def test_tmr0_is_known_after_a_known_byte_was_written_and_moves_after_one_that_moves() -> None:
    """Two cycles of inhibited counting, then one count every two cycles (DS35007 section 5)."""
    for cell, ten_later in [(7, 17), (250, 4), (7 | MOVES, 17 | MOVES)]:
        _, state = written(layout.TMR0, cell)
        assert after(state, 3) == cell
        assert after(state, 3 + 10 * 2) == ten_later
    _, state = written(layout.TMR0, 7, option=layout.PSA)  # undivided
    assert [after(state, cycles) for cycles in range(1, 6)] == [7, 7, 7, 8, 9]
    for unknown_bits in (0x01, 0x80, 0xFF):
        _, state = written(layout.TMR0, unknown_bits << 8)
        assert after(state, 23) == layout.UNKNOWN
    _, state = written(layout.TMR0, 7, option=layout.T0CS)
    assert after(state, 23) == layout.UNKNOWN, "it counts edges of RA4"


def test_an_overflow_is_seen_of_a_known_count_only() -> None:
    """From 254, two counts of two cycles after the inhibited ones; T0IF is seen one cycle ahead."""
    for cell, due in ((254, 3 + 2 * 2 - 1), (254 | MOVES, None), (0x80FF ^ 0x80, None)):
        _, state = written(layout.TMR0, cell)
        for cycle in range(1, 600):
            functions.tick(state)
            seen = bool(state[layout.INTCON] & layout.T0IF)
            assert seen == (due is not None and cycle >= due)


def test_registers_whose_unknown_bits_would_change_what_the_chip_does_are_not_written() -> None:
    """INTCON: only its three flags; EECON1: only WRERR; OPTION: none. PCLATH decides nothing by itself."""
    allowed = {layout.INTCON: 0x07, layout.EECON1: 0x08, layout.OPTION: 0x00, layout.PCLATH: 0xFF}
    for slot, mask in allowed.items():
        for bit in range(8):
            reason, _ = written(slot, 1 << bit << 8)
            assert (reason == layout.GOES_ON) == bool(mask >> bit & 1), (slot, bit)
        assert (written(slot, 4 | MOVES)[0] == layout.GOES_ON) == (mask == 0xFF)
    assert written(layout.PCLATH, 0x03 | 0x14 << 8)[1][layout.PCLATH] == 0x03 | 0x14 << 8
    assert written(layout.PCLATH, 0xFF)[1][layout.PCLATH] == 0x1F  # five bits: DS35007 section 2.3.4
