"""What one instruction makes of a state, exactly: nothing that is known before it is known less after it.

The law of `test_state` allows a state to know too little. Here everything is known, and the registers after
each instruction must be the chip's; what it reads and writes is compared with a table from the data sheet.
"""

from __future__ import annotations

import random
from itertools import product

import pytest

from servogen.pic.analysis import values
from servogen.pic.analysis.state import (
    DIGIT,
    INTCON,
    PCLATH,
    PORTA,
    PORTB,
    AbstractState,
    Effects,
    bits,
    execute,
    skip_ways,
)
from servogen.pic.analysis.values import BIT
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, STATUS, ZERO, W, word_of
from tests.pic.analysis.test_state import new_chip, registers
from tests.simulator.reference import Chip

# DS35007 table 7-2 and section 7: what an instruction reads (of W, f, C), where its result goes (W, f, d),
# and the flags that it affects.
TABLE = """
ADDWF  W,f  d C,DC,Z
ANDWF  W,f  d Z
CLRF   -    f Z
COMF   f    d Z
DECF   f    d Z
DECFSZ f    d -
INCF   f    d Z
INCFSZ f    d -
IORWF  W,f  d Z
MOVF   f    d Z
MOVWF  W    f -
RLF    f,C  d C
RRF    f,C  d C
SUBWF  W,f  d C,DC,Z
SWAPF  f    d -
XORWF  W,f  d Z
BCF    f    f -
BSF    f    f -
BTFSC  f    - -
BTFSS  f    - -
ADDLW  W    W C,DC,Z
ANDLW  W    W Z
CLRW   -    W Z
IORLW  W    W Z
MOVLW  -    W -
SUBLW  W    W C,DC,Z
XORLW  W    W Z
NOP    -    - -
CLRWDT -    - -
"""
ROWS = [line.split() for line in TABLE.split("\n") if line]
NAMED = {"W": W, "C": CARRY, "DC": DIGIT, "Z": ZERO}
WITH_FILE = [row for row in ROWS if "F" in row[0] or "f" in row[1]]
LEVELS = (0, 1, 0x0F, 0x10, 0x7F, 0x80, 0xFF)


def known(chip: Chip) -> AbstractState:
    """Return the state that knows every register of a chip, and that nothing was written."""
    places = {place: values.constant(value) for place, value in registers(chip)}
    return AbstractState(places | {INTCON: values.constant(chip.intcon & 0xF8)}, 0)


def encoded(row: list[str], *, f: int, d: int, b: int, k: int) -> int:
    """Return the word of an instruction with those of the operands that it has."""
    name, _, writes, _ = row
    if name in ("BCF", "BSF", "BTFSC", "BTFSS"):
        return encode(name, f=f, b=b)
    if row in WITH_FILE:
        return encode(name, f=f, d=d) if writes == "d" else encode(name, f=f)
    return encode(name, k=k) if name.endswith("LW") else encode(name)


def powered(rng: random.Random, word: int) -> Chip:
    """Return a chip with that instruction at 0 and random registers."""
    chip = new_chip([word, encode("NOP")])
    chip.w, chip.fsr = rng.choice((*LEVELS, rng.randrange(256))), rng.choice((0x0C, 0x2F, 0xCF, 0x8C))
    chip.status = chip.status & ~0x27 | rng.randrange(8) | rng.choice((0, 0x20))
    chip.ram = [rng.choice((*LEVELS, rng.randrange(256))) for _ in chip.ram]
    chip.tris = [rng.randrange(2) for _ in range(13)]
    chip.option, chip.pclath = rng.randrange(256), rng.randrange(32)
    return chip


def after(word: int, chip: Chip) -> tuple[AbstractState, Effects]:
    """Return the state after a step of a chip of which everything is known, and the effects of the step."""
    return execute(known(chip), word_of(word), 0)


def chips_like(chip: Chip, word: int, f: int) -> list[dict[int, int]]:
    """Return the registers after a step, for each level of the bits of STATUS that the analysis does not
    follow where it reads them: TO, PD, IRP and RP1.
    """
    found = []
    for unfollowed in range(16) if f == STATUS else [0]:
        twin = new_chip([word, encode("NOP")])
        twin.w, twin.fsr, twin.ram, twin.tris = chip.w, chip.fsr, chip.ram.copy(), chip.tris.copy()
        twin.option, twin.pclath, twin.intcon = chip.option, chip.pclath, chip.intcon
        twin.status = chip.status
        if f == STATUS:
            twin.status = chip.status & 0x27 | (unfollowed & 3) << 3 | unfollowed >> 2 << 6
        twin.run(1)
        found.append(dict(registers(twin)))
    return found


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_what_is_known_exactly_stays_known_exactly(row: list[str]) -> None:
    rng = random.Random(row[0])
    for f in (
        (0x0C, 0x30, 0x4F, FSR, STATUS, PCLATH, 0, 0x07, 0x01, PORTA, PORTB) if row in WITH_FILE else [0]
    ):
        for _ in range(6):
            word = encoded(row, f=f, d=rng.randrange(2), b=rng.randrange(8), k=rng.randrange(256))
            chip = powered(rng, word)
            if f in (1, PORTA, PORTB):
                chip.status |= 0x20  # in bank 1 they are OPTION_REG, TRISA and TRISB
            state, _ = after(word, chip)
            chips = chips_like(chip, word, f)
            for place in chips[0]:
                if place == DIGIT and "DC" in row[3]:
                    assert state.get(DIGIT) is BIT
                else:
                    assert state.get(place) is values.of(each[place] for each in chips), f"{place}: 0x{f:02X}"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_what_an_instruction_reads_and_writes_is_what_the_data_sheet_says(row: list[str]) -> None:
    rng = random.Random(row[0])
    name, reads, writes, flags = row
    for d in (0, 1):
        word = encoded(row, f=0x25, d=d, b=rng.randrange(8), k=rng.randrange(256))
        _, effects = after(word, powered(rng, word))
        state, _ = after(word, powered(rng, word))
        destination = {"W": {W}, "f": {0x25}, "d": {0x25 if d else W}, "-": set()}[writes]
        affected = {NAMED[flag] for flag in flags.replace("-", "").split(",") if flag}
        read = {{"W": W, "f": 0x25, "C": CARRY}[each] for each in reads.replace("-", "").split(",") if each}
        assert effects.unwritten == read, name
        assert effects.changed == destination | affected, name
        assert state.written == bits(destination | affected), name
        assert (effects.any_byte, effects.wild, effects.jumps, effects.pins) == (False, False, False, [])
        assert (effects.driven_unwritten, effects.timer_writes) == (set(), None)


SMALL = ((0,), (0, 1), (0x7F, 0x80), (0, 3, 0xFF), (5, 0x50))


def every_step(word: int, choices: dict[int, tuple[int, ...]]) -> dict[int, list[dict[int, int]]]:
    """Return the registers of every chip with a choice of W, the byte 0x25 and the carry after a step, by the
    address that it comes to.
    """
    ends: dict[int, list[dict[int, int]]] = {}
    for w, f, carry in product(choices[W], choices[0x25], choices[CARRY]):
        chip = new_chip([word, encode("NOP"), encode("NOP")])
        chip.w, chip.ram[0x25 - 0x0C], chip.fsr, chip.status = w, f, 0x25, chip.status & ~7 | carry
        chip.run(1)
        ends.setdefault(chip.pc, []).append(dict(registers(chip)))
    return ends


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_of_small_sets_every_combination_counts_and_nothing_else(row: list[str]) -> None:
    """Of a skip, each way holds exactly what leads there; a way that nothing leads to is not gone."""
    rng = random.Random(row[0])
    for turn in range(10):
        word = encoded(row, f=rng.choice((0, 0x25)), d=turn % 2, b=rng.choice((0, 7)), k=rng.randrange(256))
        choices = {W: rng.choice(SMALL), 0x25: rng.choice(SMALL), CARRY: rng.choice(((0,), (1,), (0, 1)))}
        ends = every_step(word, choices)
        chip = new_chip([word])
        chip.fsr, chip.status = 0x25, chip.status & ~7
        before = known(chip)
        before.values |= {place: values.of(members) for place, members in choices.items()}
        state, _ = execute(before, word_of(word), 0)
        row_skips = word_of(word).flow == "skip"
        ways = skip_ways(state, before, word_of(word), 0) if row_skips else [(1, state)]
        assert sorted(to for to, _ in ways) == sorted(ends)
        for to, reached in ways:
            for place in ends[to][0]:
                if place != DIGIT or "DC" not in row[3]:
                    expected = values.of(registers_[place] for registers_ in ends[to])
                    # A test of 0x25 tells nothing of the other registers, nor does DECFSZ f,W of its byte.
                    apart = row_skips and place == 0x25 and word_of(word).writes_w
                    assert reached.get(place) is (before.get(place) if apart else expected), (to, place)
