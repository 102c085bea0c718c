"""One instruction on known values: exactly the chip's registers, and unknown only what comes from outside."""

from __future__ import annotations

import random

import pytest

from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, ZERO, Undefined, W, execute, place_of, skipped, word_of
from tests.pic.analysis.test_exactness import ROWS, WITH_FILE, encoded, powered
from tests.simulator.reference import C, Chip, Z

RAM = range(0x0C, 0x50)
NAMED = {"C": CARRY, "Z": ZERO}


def known_of(chip: Chip) -> dict[int, int]:
    """Return the values of a chip that are followed."""
    flags = {CARRY: int(bool(chip.status & C)), ZERO: int(bool(chip.status & Z))}
    return {W: chip.w, FSR: chip.fsr, **flags, **{at: chip.ram[at - 0x0C] for at in RAM}}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_what_is_known_stays_known_and_is_what_the_chip_has(row: list[str]) -> None:
    rng = random.Random(row[0])
    _, _, writes, flags = row
    for f in (0x0C, 0x4F, 0x30, FSR, 0, 0x50, 0x0B, 0x06) if row in WITH_FILE else (0,):
        for turn in range(8):
            word = word_of(encoded(row, f=f, d=turn % 2, b=rng.randrange(8), k=rng.randrange(256)))
            chip = powered(rng, encoded(row, f=f, d=turn % 2, b=word.b, k=word.k))
            chip.fsr = rng.choice((0x0C, 0x2F, 0xCF))
            known = known_of(chip)
            skips = skipped(word, known) if word.flow == "skip" else execute(word, known)
            chip.run(1)
            reads_outside = f in (0x50, 0x0B, 0x06) and "f" in row[1] and row in WITH_FILE
            unknown = set()
            if reads_outside:
                unknown |= {W} if writes == "d" and word.writes_w else set()
                unknown |= {NAMED[flag] for flag in flags.split(",") if flag in NAMED}
            assert known == {
                place: value for place, value in known_of(chip).items() if place not in unknown
            }, f
            if word.flow == "skip":
                assert skips is (None if reads_outside else chip.pc == 2)


def test_flags_are_followed_through_status() -> None:
    for name, bit, before, after in (
        ("BSF", 0, {}, {CARRY: 1}), ("BCF", 0, {CARRY: 1, ZERO: 1}, {CARRY: 0, ZERO: 1}),
        ("BSF", 2, {CARRY: 0}, {CARRY: 0, ZERO: 1}), ("BCF", 2, {}, {ZERO: 0}),
        ("BSF", 1, {CARRY: 0, ZERO: 1}, {CARRY: 0, ZERO: 1}), ("BCF", 5, {CARRY: 0}, {CARRY: 0}),
    ):  # fmt: skip
        known = dict(before)
        execute(word_of(encode(name, f=3, b=bit)), known)
        assert known == after
    for word in (
        encode("MOVWF", f=3),
        encode("CLRF", f=3),
        encode("XORWF", f=3, d=1),
        encode("SWAPF", f=3, d=1),
    ):
        known = {W: 1, CARRY: 0, ZERO: 1, 0x20: 4}
        execute(word_of(word), known)
        assert known == {W: 1, 0x20: 4}
    known = {CARRY: 0, ZERO: 1}
    execute(word_of(encode("SWAPF", f=3, d=0)), known)
    assert known == {CARRY: 0, ZERO: 1}


@pytest.mark.parametrize(
    ("bit", "known", "is_1"),
    [(0, {CARRY: 1}, True), (0, {CARRY: 0}, False), (2, {ZERO: 1}, True), (2, {CARRY: 1}, None),
     (1, {CARRY: 1}, None),
     (5, {ZERO: 1}, None), (7, {CARRY: 0}, None)],
)  # fmt: skip
def test_a_test_of_status_is_decided_by_the_flags_that_are_known(
    bit: int, known: dict[int, int], is_1: bool | None
) -> None:
    assert skipped(word_of(encode("BTFSS", f=3, b=bit)), dict(known)) is is_1
    assert skipped(word_of(encode("BTFSC", f=3, b=bit)), dict(known)) is (None if is_1 is None else not is_1)


def test_bytes_that_change_at_any_time_are_never_known() -> None:
    known = {W: 3, 0x20: 5, 0x21: 5}
    execute(word_of(encode("MOVWF", f=0x20)), known, changing={0x20})
    assert known == {W: 3, 0x21: 5}
    known = {0x20: 1}
    assert skipped(word_of(encode("DECFSZ", f=0x20, d=1)), known, changing={0x20}) is None
    assert known == {}
    known = {0x20: 1}
    assert skipped(word_of(encode("DECFSZ", f=0x20, d=0)), known, changing={0x20}) is True
    assert known == {W: 0, 0x20: 1}


def test_a_write_through_an_unknown_pointer_forgets_all_of_ram_and_the_flags_and_nothing_else() -> None:
    known = {W: 3, FSR: 3, CARRY: 1, ZERO: 1, 0x0C: 5, 0x4F: 5}
    execute(word_of(encode("MOVWF", f=0)), known)
    assert known == {W: 3, FSR: 3}, "0x03 is STATUS"
    known = {W: 3, FSR: 0xA0, 0x20: 5, 0x21: 6}
    execute(word_of(encode("MOVWF", f=0)), known)
    assert known == {W: 3, FSR: 0xA0, 0x20: 3, 0x21: 6}, "0xA0 is 0x20 in bank 1"
    known = {W: 3, FSR: 0x06, 0x20: 5}
    execute(word_of(encode("INCF", f=0, d=0)), known)
    assert known == {FSR: 0x06, 0x20: 5}


def test_the_places_that_an_operand_addresses() -> None:
    for f in range(1, 0x80):
        assert place_of(f, {FSR: 0x20}) == (f if f == FSR or f in RAM else None)
    for pointer, place in (
        (0x0C, 0x0C),
        (0x8C, 0x0C),
        (0xCF, 0x4F),
        (0x50, None),
        (0x04, FSR),
        (0x84, FSR),
        (3, None),
    ):
        assert place_of(0, {FSR: pointer}) == place
    assert place_of(0, {}) is None


def test_words_that_no_data_sheet_defines_are_refused_and_the_others_have_their_facts() -> None:
    for number in (0x0001, 0x3B00):
        with pytest.raises(Undefined):
            word_of(number)
    jump, write, read = (word_of(encode("ADDWF", f=f, d=d)) for f, d in ((2, 1), (0x20, 1), (2, 0)))
    assert [word.writes_pcl for word in (jump, write, read)] == [True, False, False]
    assert [word.place for word in (jump, write, read)] == [None, 0x20, None]
    assert (write.sets_carry, write.sets_zero, write.writes_w, read.writes_w) == (True, True, False, True)
    move = word_of(encode("MOVLW", k=0x20))
    assert (move.place, move.has_f, move.writes_f, move.k) == (None, False, False, 0x20)
