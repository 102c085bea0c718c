"""A byte that is its value plus φ: whatever φ is, the chip holds what the tracked one says.

The law: a random program runs on a tracked chip whose bytes are known, unknown or PHASED, and on plain chips
with some φ and some unknown bits chosen. Each plain chip's bytes and flags lie in what the tracked chip says.
"""

from __future__ import annotations

import random

import pytest

from servogen.pic.device import RAM_FIRST
from servogen.pic.image import Image
from servogen.pic.isa import INSTRUCTIONS, encode
from servogen.simulator import Machine, layout
from servogen.simulator.layout import PHASED
from tests.campaigns import sampled
from tests.simulator.helpers import CLOCK

BYTES = range(RAM_FIRST, RAM_FIRST + 5)
TMR0_ADDRESS, STATUS_ADDRESS = 1, 3
ON_FILES = [row.mnemonic for row in INSTRUCTIONS if "f" in row.operands and row.flow == "next"]
ON_W = [row.mnemonic for row in INSTRUCTIONS if row.operands == "k" and row.flow == "next"]
LENGTH = 12
WATCHDOG_OFF = 0x3FF9


def random_words(rng: random.Random) -> list[int]:
    words = []
    for _ in range(LENGTH):
        if rng.random() < 0.2:
            words.append(encode(rng.choice(ON_W), k=rng.choice((0, 1, 3, 0xFF, rng.randrange(256)))))
            continue
        name = rng.choice((*ON_FILES, "MOVF", "SUBWF", "ADDWF", "XORWF", "MOVWF"))
        row = next(row for row in INSTRUCTIONS if row.mnemonic == name)
        fields = {"f": rng.choice((*BYTES, *BYTES, TMR0_ADDRESS))}
        if "d" in row.operands:
            fields["d"] = rng.randrange(2)
        if "b" in row.operands:
            fields["b"] = rng.randrange(8)
        words.append(encode(name, **fields))
    return words


def prepared(words: list[int], *, tracked: bool, option: int = 0x84) -> Machine:
    program = [encode("MOVLW", k=option), encode("OPTION"), *words]
    program.append(encode("GOTO", k=len(program)))
    chip = Machine(Image(dict(enumerate(program)), WATCHDOG_OFF), CLOCK, tracked=tracked)
    chip.run(2)
    return chip


@pytest.mark.parametrize("seed", sampled(range(400), 30))
def test_every_phase_lies_in_what_the_tracked_chip_says(seed: int) -> None:
    rng = random.Random(seed)
    words, option = random_words(rng), rng.choice((0x84, 0x80, 0x88))
    chip = prepared(words, tracked=True, option=option)
    tracked = chip.numbers
    cells = {}  # slot: (value, unknown bits)
    for slot in (*BYTES, layout.W, layout.TMR0):
        kind = rng.randrange(3) if slot != layout.TMR0 else 2
        cells[slot] = (rng.randrange(256), (0, rng.choice((0x81, 0xFF, 0x0F)) | 1 << 8, PHASED)[kind])
    for slot in BYTES:
        tracked[slot] = cells[slot][0] | cells[slot][1] << layout.UNKNOWN_SHIFT
    tracked[layout.W], tracked[layout.W_UNKNOWN] = cells[layout.W]
    tracked[layout.TMR0], tracked[layout.TMR0_UNKNOWN] = cells[layout.TMR0]
    tracked[layout.STATUS_UNKNOWN] = 0
    chip.run(LENGTH)
    plain = prepared(words, tracked=False, option=option)
    start = plain.snapshot()
    for _ in range(12):
        phase = rng.choice((0, 1, 0xFF, rng.randrange(256)))
        plain.restore(start)
        for slot, (value, unknown) in cells.items():
            chosen = value + phase if unknown == PHASED else value ^ rng.randrange(256) & unknown & 0xFF
            plain.numbers[slot] = chosen & 0xFF
        plain.run(LENGTH)
        for slot in BYTES:
            said = int(tracked[slot])
            check(int(plain.numbers[slot]) & 0xFF, said & 0xFF, said >> layout.UNKNOWN_SHIFT, phase)
        timer = int(tracked[layout.TMR0]), int(tracked[layout.TMR0_UNKNOWN])
        check(int(plain.numbers[layout.TMR0]), *timer, phase)
        check(int(plain.numbers[layout.W]), int(tracked[layout.W]), int(tracked[layout.W_UNKNOWN]), phase)
        flags = int(tracked[layout.STATUS_UNKNOWN])
        check(int(plain.numbers[layout.STATUS]), int(tracked[layout.STATUS]), flags, phase)


def check(value: int, said: int, unknown: int, phase: int) -> None:
    if unknown == PHASED:
        assert value == (said + phase) & 0xFF
    else:
        assert (value ^ said) & ~unknown & 0xFF == 0


def after(words: list[int], **cells: tuple[int, int]) -> Machine:
    """Return a tracked chip after `words`, of whose RAM bytes `first` and `second` were set so before."""
    chip = prepared(words, tracked=True)
    chip.numbers[layout.STATUS_UNKNOWN] = 0
    for name, (value, unknown) in cells.items():
        slot = BYTES[0] if name == "first" else BYTES[1]
        chip.numbers[slot] = value | unknown << layout.UNKNOWN_SHIFT
    chip.run(len(words))
    return chip


def test_the_difference_of_two_phased_bytes_is_known() -> None:
    subtract = [encode("MOVF", f=BYTES[0]), encode("SUBWF", f=BYTES[1])]
    chip = after(subtract, first=(250, PHASED), second=(3, PHASED))
    assert (int(chip.numbers[layout.W]), int(chip.numbers[layout.W_UNKNOWN])) == (9, 0)
    assert int(chip.numbers[layout.STATUS_UNKNOWN]) & 0xFF == 0b011  # C and DC depend on φ, Z does not


@pytest.mark.parametrize(("second", "zero"), [(7, 4), (8, 0)])
def test_whether_two_phased_bytes_are_equal_is_known(second: int, zero: int) -> None:
    compare = [encode("MOVF", f=BYTES[0]), encode("XORWF", f=BYTES[1])]
    chip = after(compare, first=(7, PHASED), second=(second, PHASED))
    assert int(chip.numbers[layout.STATUS]) & 4 == zero
    assert int(chip.numbers[layout.STATUS_UNKNOWN]) == 0


def test_a_phased_byte_by_itself_is_unknown() -> None:
    skip = [encode("BTFSC", f=BYTES[0], b=0), encode("NOP")]
    chip = after(skip, first=(7, PHASED))
    assert chip.chip_dependent


def test_a_known_byte_less_a_phased_one_is_not_phased() -> None:
    subtract = [encode("MOVF", f=BYTES[0]), encode("SUBWF", f=BYTES[1])]
    chip = after(subtract, first=(7, PHASED), second=(9, 0))
    assert int(chip.numbers[layout.W_UNKNOWN]) & 0xFF == 0xFF
    assert int(chip.numbers[layout.W_UNKNOWN]) != PHASED
