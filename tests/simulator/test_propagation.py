"""Which bits of a result are unknown, neither fewer nor more: by trying every choice of the unknown bits.

What an addition or subtraction leaves unknown is every bit that a carry out of an unknown bit could reach.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import Machine
from servogen.simulator import layout as at
from tests.simulator.helpers import CLOCK

F, C, DC, Z = 0x20, 1, 2, 4
OF_F, OF_W, OF_C = 0x31, 0x32, 0x33
"""Sources of unknown bits: three bytes of RAM."""


def choices(value: int, mask: int) -> Iterator[int]:
    """Yield the value with every choice of the bits of the mask."""
    choice = 0
    while True:
        yield value & ~mask | choice
        choice = (choice - mask) & mask
        if not choice:
            return


def bits_set(byte: int) -> int:
    return bin(byte).count("1")


def bitwise(name: str, f: int, w: int, c: int, bit: int) -> tuple[int, int | None, int | None]:
    """Return result, Z and C, None where the instruction leaves a flag alone (DS35007 table 7-2)."""
    result = {
        "ANDWF": f & w, "ANDLW": f & w, "IORWF": f | w, "IORLW": f | w, "XORWF": f ^ w, "XORLW": f ^ w,
        "COMF": f ^ 0xFF, "MOVF": f, "SWAPF": f % 16 * 16 + f // 16, "RLF": (2 * f + c) % 256,
        "RRF": f // 2 + 128 * c, "BCF": f & ~(1 << bit), "BSF": f | 1 << bit,
    }[name]  # fmt: skip
    zero = int(result == 0) if name[:3] in ("AND", "IOR", "XOR", "COM", "MOV") else None
    carry = {"RLF": f >> 7, "RRF": f & 1}.get(name)
    return result, zero, carry


ON_FILE = ["ANDWF", "IORWF", "XORWF", "COMF", "MOVF", "SWAPF", "RLF", "RRF", "BCF", "BSF"]
LITERAL = ["ANDLW", "IORLW", "XORLW"]
ARITHMETIC = ["ADDWF", "SUBWF", "ADDLW", "SUBLW", "INCF", "DECF", "INCFSZ", "DECFSZ"]


@cache
def powered(word: int) -> tuple[Machine, np.ndarray]:
    """Return a tracked machine with this instruction, and its state at power-up."""
    chip = Machine(Image({0: word}, 0x3FF1), CLOCK, tracked=True)
    return chip, chip.numbers.copy()


def executed(
    name: str, f: tuple[int, int], w: tuple[int, int], flags: tuple[int, int], bit: int = 0
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Execute one instruction on values with unknown bits; return (result, its unknown bits) and STATUS's."""
    if name.endswith("LW"):
        word = encode(name, k=f[0])
    elif name in ("BCF", "BSF"):
        word = encode(name, f=F, b=bit)
    else:
        word = encode(name, f=F, d=1)
    chip, fresh = powered(word)
    s = chip.numbers
    s[:] = fresh
    s[F] = f[0] | (f[1] | OF_F << 8 if f[1] else 0) << at.UNKNOWN_SHIFT
    s[at.W], s[at.W_UNKNOWN] = w[0], w[1] | OF_W << 8 if w[1] else 0
    s[at.STATUS], s[at.STATUS_UNKNOWN] = 0x18 | flags[0], flags[1] | OF_C << 8 if flags[1] else 0
    chip.step()
    status = int(s[at.STATUS]), int(s[at.STATUS_UNKNOWN])
    if name.endswith("LW"):
        return (int(s[at.W]), int(s[at.W_UNKNOWN])), status
    return (int(s[F]) & 0xFF, int(s[F]) >> at.UNKNOWN_SHIFT), status


def operands(rng: random.Random, literal: bool) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
    masks = (0, 0, 0x01, 0x80, 0x10, 0x0F, 0xF0, 0x42, rng.getrandbits(8) & rng.getrandbits(8))
    f = (0, 0x80, 0x5A, 0xFF, 0x0C)[rng.randrange(5)], 0 if literal else rng.choice(masks)
    w = rng.choice((0, 0xFF, 0x0F, 0x81, rng.getrandbits(8))), rng.choice(masks)
    return f, w, (rng.getrandbits(3), rng.choice((0, 0, 1, 4, 7)))


@pytest.mark.parametrize("name", [*ON_FILE, *LITERAL])
def test_a_bit_is_unknown_exactly_if_some_choice_changes_it(name: str) -> None:
    rng = random.Random(name)
    for _ in range(60):
        f, w, flags = operands(rng, name in LITERAL)
        bit = rng.randrange(8)
        (value, unknown), (status, doubt) = executed(name, f, w, flags, bit)
        on_w = name[:3] in ("AND", "IOR", "XOR")
        found = [
            bitwise(name, one, other, carry & 1, bit)
            for one in choices(*f)
            for other in (choices(*w) if on_w else [w[0]])
            for carry in (choices(flags[0] & 1, flags[1] & 1) if name in ("RLF", "RRF") else [flags[0]])
        ]
        results = {result for result, _, _ in found}
        varies = 0
        for result in results:
            varies |= result ^ found[0][0]
        assert unknown & 0xFF == varies, (name, f, w, flags)
        assert any((value ^ result) & ~varies & 0xFF == 0 for result in results)
        zeros, carries = {zero for _, zero, _ in found}, {carry for _, _, carry in found}
        expected = flags[1] & DC
        expected |= flags[1] & Z if None in zeros else Z * (len(zeros) > 1)
        expected |= flags[1] & C if None in carries else C * (len(carries) > 1)
        assert doubt & 0xFF == expected, (name, f, w, flags)
        if None not in zeros and len(zeros) == 1:
            assert bool(status & Z) is bool(zeros.pop())


@pytest.mark.parametrize("name", ARITHMETIC)
def test_a_carry_makes_the_higher_bits_unknown(name: str) -> None:
    rng = random.Random(name)
    with_w = name[:3] in ("ADD", "SUB")
    for _ in range(60):
        f, w, flags = operands(rng, name.endswith("LW"))
        (value, unknown), (_, doubt) = executed(name, f, w, flags)
        mask = f[1] | w[1] if with_w else f[1]
        lowest = next((bit for bit in range(8) if mask >> bit & 1), 8)
        reached = 0xFF >> lowest << lowest
        assert unknown & 0xFF == reached, (name, f, w)
        changed = C | DC | Z if with_w else Z if name in ("INCF", "DECF") else 0
        expected = flags[1] & ~changed
        if with_w and mask:
            expected |= C | (DC if lowest < 4 else 0)
        if changed and mask and value & ~reached & 0xFF == 0:
            expected |= Z
        assert doubt & 0xFF == expected, (name, f, w, flags)


@pytest.mark.parametrize("name", [*ON_FILE, *LITERAL, *ARITHMETIC])
def test_the_source_is_that_of_the_register_then_of_w_then_of_the_carry(name: str) -> None:
    on_w = name.endswith(("WF", "LW")) and name not in ("MOVLW",)
    on_c = name in ("RLF", "RRF")
    literal = name.endswith("LW")
    for f, w, c in ((0x18, 0, 0), (0x18, 0x3C, 1), (0, 0x3C, 0), (0, 0, 1), (0, 0x3C, 1), (0, 0, 0)):
        if literal and f:
            continue
        # Known bits that hide no unknown one: 1 where bits are masked by AND, 0 where by IOR.
        known = 0xFF if name.startswith("AND") else 0
        (_, unknown), (_, doubt) = executed(name, (known & ~f, f), (known & ~w, w), (0, c), bit=0)
        sources = [OF_F] * bool(f) + [OF_W] * bool(w and on_w) + [OF_C] * bool(c and on_c)
        assert unknown >> 8 == (sources[0] if sources and unknown & 0xFF else 0)
        assert bool(sources) is bool(unknown & 0xFF)
        flags = doubt & 0xFF
        assert (doubt >> 8 != 0) is bool(flags)
        if flags & ~(1 if c else 0) and sources:
            assert doubt >> 8 in sources


def test_a_choice_of_bits_is_every_choice() -> None:
    for mask in (0, 1, 0x81, 0x42, 0xFF):
        found = list(choices(0x24 & ~mask, mask))
        assert len(found) == len(set(found)) == 2 ** bits_set(mask)
        assert {each & ~mask for each in found} == {0x24 & ~mask}


def combined(name: str, f: tuple[int, int], w: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the result of an addition or subtraction, its unknown bits, STATUS and its unknown bits."""
    chip, fresh = powered(encode(name, f=F, d=1))
    s = chip.numbers
    s[:] = fresh
    s[F] = f[0] | f[1] << at.UNKNOWN_SHIFT
    s[at.W], s[at.W_UNKNOWN] = w
    s[at.STATUS], s[at.STATUS_UNKNOWN] = 0x18, 0
    chip.step()
    result, unknown = int(s[F]) & 0xFF, int(s[F]) >> at.UNKNOWN_SHIFT & 0xFF
    return result, unknown, int(s[at.STATUS]), int(s[at.STATUS_UNKNOWN])


@pytest.mark.parametrize(("f", "w"), [(0x30, 0x30), (0x31, 0x30), (0x30, 0x31), (0xFF, 0x00)])
def test_of_two_counts_of_one_timer_the_difference_is_known_and_the_sum_is_not(f: int, w: int) -> None:
    """Both have the same unknown φ added: (f + φ) - (w + φ) is f - w, but which borrows depends on φ."""
    result, unknown, status, doubtful = combined("SUBWF", (f, at.PHASED), (w, at.PHASED))
    assert (result, unknown, status & Z, doubtful & Z) == ((f - w) % 256, 0, Z if f == w else 0, 0)
    borrows = {(f + phi) % 256 < (w + phi) % 256 for phi in range(256)}
    assert doubtful & C or len(borrows) == 1
    assert combined("ADDWF", (f, at.PHASED), (w, at.PHASED))[1] == 0xFF
    for one, other in ((at.PHASED, 0), (0, at.PHASED), (at.PHASED, 0x80 | OF_W << 8)):
        assert combined("SUBWF", (f, one), (w, other))[1] == 0xFF
