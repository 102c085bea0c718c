"""The law of one step: what a chip can do in an instruction lies within what the abstract state says.

A chip is drawn from a random abstract state, both execute the same random instructions, and after each of
them every register of the chip must have a value that the abstract state allows. The chip is the reference
of the simulator's tests, which shares nothing with the analysis.
"""

from __future__ import annotations

import random
from collections.abc import Iterator

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
    at_reset,
    bit,
    execute,
    operands,
    skip_ways,
)
from servogen.pic.analysis.values import Value
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, PCL, ZERO, W, word_of
from tests.campaigns import sampled
from tests.simulator.reference import DC, RP0, C, Chip, Z, number

STEPS = 14
RAM = (0x0C, 0x0D, 0x30, 0x4F)
FILES = (*RAM, *RAM, 0, 1, 3, 4, 5, 6, 8, 9, 0x0A)
"""Operands of the instructions: what is written to PCL and INTCON is left to the tests of whole programs."""
POINTERS = (*RAM, 0x8C, 0xCF, 0x05, 0x06, 0x83, 0x81, 0x84, 0x00, 0x07)
BYTES = "ADDWF ANDWF CLRF COMF DECF DECFSZ INCF INCFSZ IORWF MOVF MOVWF RLF RRF SUBWF SWAPF XORWF"
LITERALS = ("ADDLW", "ANDLW", "IORLW", "MOVLW", "SUBLW", "XORLW")
FLAGS = {CARRY: C, DIGIT: DC, ZERO: Z, BANK: RP0}


def instruction(rng: random.Random) -> int:
    """Return a random word."""
    kind = rng.random()
    if kind < 0.2:
        return encode(rng.choice(LITERALS), k=rng.choice((0, 1, 3, 0x0F, 0x80, 0xFF, rng.randrange(256))))
    if kind < 0.25:
        return encode("CLRW")
    if kind < 0.5:
        name = rng.choice(("BCF", "BSF", "BTFSC", "BTFSS"))
        file = 3 if rng.random() < 0.4 else rng.choice(FILES)
        return encode(name, f=file, b=rng.choice((0, 1, 2, 5)) if file == 3 else rng.randrange(8))
    name, file = rng.choice(BYTES.split()), rng.choice(FILES)
    if name in ("CLRF", "MOVWF"):
        return encode(name, f=file)
    return encode(name, f=file, d=rng.randrange(2))


def some_value(rng: random.Random, member: int) -> Value:
    """Return a value that has `member` among others."""
    kind = rng.randrange(4)
    if kind == 0:
        return values.constant(member)
    if kind == 1:
        return values.of({member, *(rng.randrange(256) for _ in range(rng.randint(1, 4)))})
    free = rng.randrange(256) if kind == 2 else 1 << rng.randrange(8)
    return values.of_bits(~member & 0xFF | free, member | free)


def drawn(rng: random.Random, chip: Chip) -> AbstractState:
    """Give the chip random registers, and return an abstract state that it lies in."""
    state = at_reset()
    chip.w, chip.fsr = rng.choice((0, 1, 0xFF, rng.randrange(256))), rng.choice(POINTERS)
    chip.status = chip.status & ~7 | rng.randrange(8)
    chip.tris, chip.latch = [rng.randrange(2) for _ in range(13)], [rng.randrange(2) for _ in range(13)]
    for address in RAM:
        chip.ram[address - 0x0C] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
        if rng.random() < 0.8:
            state.values[address] = some_value(rng, chip.ram[address - 0x0C])
    if rng.random() < 0.8:
        state.values[W] = some_value(rng, chip.w)
    pointers = {chip.fsr, *rng.choices(POINTERS, k=rng.randrange(3))}
    state.values[FSR] = values.of(pointers)
    for place, mask in FLAGS.items():
        if place != BANK and rng.random() < 0.5:
            state.values[place] = values.constant(int(bool(chip.status & mask)))
    state.values[TRISA] = some_value(rng, number(chip.tris[:5])) if rng.random() < 0.7 else values.ANY
    state.values[TRISB] = some_value(rng, number(chip.tris[5:])) if rng.random() < 0.7 else values.ANY
    state.values = {place: value for place, value in state.values.items() if value is not values.ANY}
    for place in (*RAM, W, FSR, CARRY, DIGIT, ZERO, TMR0, *(LATCHES + pin for pin in range(13))):
        state.written |= bit(place)
    return state


def registers(chip: Chip) -> Iterator[tuple[int, int]]:
    """Yield each place that the analysis follows, and its value on the chip."""
    yield W, chip.w
    yield FSR, chip.fsr
    yield PCLATH, chip.pclath
    yield OPTION, chip.option
    yield TRISA, number(chip.tris[:5])
    yield TRISB, number(chip.tris[5:])
    for place, mask in FLAGS.items():
        yield place, int(bool(chip.status & mask))
    for address in range(0x0C, 0x50):
        yield address, chip.ram[address - 0x0C]


def misfits(state: AbstractState, chip: Chip) -> list[tuple[int, int]]:
    """Return the places of the chip whose value the state rules out."""
    wrong = [(place, value) for place, value in registers(chip) if value not in state.get(place)]
    wrong += [(place, -1) for place, fact in state.facts.items() if not _holds(fact, chip, place)]
    copies = dict(registers(chip))
    wrong += [(place, chip.w) for place in state.copies if copies.get(place, chip.w) != chip.w]
    return wrong


def _holds(fact: tuple[int, str, int], chip: Chip, flag: int) -> bool:
    other, relation, limit = fact
    member = chip.w if other == W else dict(registers(chip)).get(other)
    if member is None:  # a port or a register of the EEPROM, which may change at any time
        return True
    level = bool(chip.status & FLAGS[flag])
    meanings = {"==": member == limit, ">=": member >= limit, "<=": member <= limit, "&": member & limit == 0}
    return level == meanings[relation]


def new_chip(words: list[int]) -> Chip:
    return Chip(Image(dict(enumerate(words)), config=0x3FF1))


@pytest.mark.parametrize("first", sampled(range(0, 1200, 200), 2))
def test_a_step_of_any_chip_lies_within_the_step_of_its_state(first: int) -> None:
    for seed in range(first, first + 200):
        rng = random.Random(seed)
        words = [instruction(rng) for _ in range(STEPS)]
        chip = new_chip(words)
        state = drawn(rng, chip)
        assert misfits(state, chip) == []
        while chip.pc < STEPS:
            at = chip.pc
            word, before = word_of(words[at]), state
            touched, _ = operands(before, word.f) if word.has_f else ([], False)
            if any(operand.special in (PCL, INTCON) for operand in touched) and word.writes_f:
                break
            if word.has_f and operands(before, word.f)[1]:
                break  # a completely unknown pointer: the analysis states that it takes it to address RAM
            state, _ = execute(before, word, at)
            chip.run(chip.now + 1)
            where = f"seed {seed}, instruction {at}: {word.name} 0x{word.f:02X}"
            if "skip" in word.flow:
                states = [
                    after
                    for words_on, after in skip_ways(state, before, word, at)
                    if at + words_on == chip.pc
                ]
                assert states, f"{where} cannot go to {chip.pc}"
                fitting = [after for after in states if not misfits(after, chip)]
                assert fitting, f"{where}: {[misfits(after, chip) for after in states]}"
                state = fitting[0]
            assert misfits(state, chip) == [], where


def after_some_steps(seed: int) -> tuple[AbstractState, Chip]:
    """Return a chip after a few instructions, and the state that follows from the one it lay in."""
    rng = random.Random(seed)
    words = [instruction(rng) for _ in range(STEPS)]
    words = [word for word in words if word_of(word).flow == "next"][: rng.randint(0, 6)]
    words += [encode("MOVF", f=RAM[0], d=0), encode("MOVWF", f=RAM[1])][: rng.randrange(3)]
    chip = new_chip(words)
    state = drawn(rng, chip)
    for at, code in enumerate(words):
        word = word_of(code)
        touched, unknown = operands(state, word.f) if word.has_f else ([], False)
        if unknown or any(operand.special in (PCL, INTCON) for operand in touched):
            break
        state, _ = execute(state, word, at)
        chip.run(chip.now + 1)
    return state, chip


def test_a_split_keeps_every_chip_and_a_join_keeps_the_chips_of_both_states() -> None:
    for seed in range(0, 800, 2):
        (one, chip), (other, second) = after_some_steps(seed), after_some_steps(seed + 1)
        assert misfits(one, chip) == misfits(other, second) == []
        for place in one.values:
            if one.get(place).size <= 16:
                assert any(not misfits(part, chip) for part in one.split(place)), f"seed {seed}, {place}"
        one.join(other)
        assert misfits(one, chip) == misfits(one, second) == [], f"seed {seed}"


def test_what_an_interrupt_changes_is_forgotten_with_its_copies_and_the_flags_that_tell_of_it() -> None:
    def state() -> AbstractState:
        known = {W: 5, 0x20: 5, 0x21: 5, ZERO: 1, CARRY: 0}
        facts = {ZERO: (0x20, "==", 5), CARRY: (0x21, ">=", 9)}
        saved = {0x21: (FSR, False)}
        return AbstractState(
            {place: values.constant(byte) for place, byte in known.items()}, 0, saved, facts, (0x20, 0x21)
        )

    changed = state()
    changed.forget({0x20, 0x30})
    assert changed.values.keys() == {W, 0x21, ZERO, CARRY}
    assert changed.copies == (0x21,)
    assert changed.facts == {CARRY: (0x21, ">=", 9)}
    assert changed.saved == {0x21: (FSR, False)}
    changed = state()
    changed.forget({W, CARRY, 0x21})
    assert changed.values.keys() == {0x20, ZERO}
    assert (changed.copies, changed.saved) == ((), {})
    assert changed.facts == {ZERO: (0x20, "==", 5)}
