"""Which bits of a result are unknown, neither fewer nor more: by trying every choice of the unknown bits.

What an addition or subtraction leaves unknown is every bit that a carry out of an unknown bit could reach.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import cache
from itertools import product

import numpy as np
import pytest

from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import Machine
from servogen.simulator import layout as at
from servogen.simulator.warnings import subjects
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
    return chip, chip._s.copy()


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
    s = chip._s
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
    s = chip._s
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


# Special function registers ---------------------------------------------------------------------------------

SLOTS = {3: at.STATUS, 4: at.FSR, 8: at.EEDATA, 9: at.EEADR, 0x0A: at.PCLATH, 0x02: at.PC}
"""By address in bank 0; the bits of the first four may be unknown."""
USED = {
    3: (0x20, at.USE_BANK), 4: (0, 0), 8: (0, 0), 9: (0, 0),
    0x0A: (0x1F, at.USE_REGISTER), 0x02: (0xFF, at.USE_JUMP),
}  # fmt: skip
"""The bits of a register on which something depends at once, and what."""


@cache
def untracked(word: int) -> tuple[Machine, np.ndarray]:
    chip = Machine(Image({0: word}, 0x3FF1), CLOCK)
    return chip, chip._s.copy()


@pytest.mark.parametrize("address", SLOTS)
def test_a_bit_of_a_register_is_unknown_exactly_if_some_choice_changes_it(address: int) -> None:
    """Every choice is executed by a chip that tracks nothing: result, W, STATUS, and what depends on it."""
    rng = random.Random(address)
    masks = (0, 0x01, 0x04, 0x18, 0x81, 0x26)
    for name in (*ON_FILE, "MOVWF", "CLRF", "BTFSC", "BTFSS") * 10:
        fields = {"f": address}
        if name in ("BCF", "BSF", "BTFSC", "BTFSS"):
            fields["b"] = rng.choice((0, 1, 2, 5, 7))
        elif name not in ("MOVWF", "CLRF"):
            fields["d"] = rng.randrange(2)
        word = encode(name, **fields)
        known = {at.W: rng.randrange(256), at.STATUS: 0x18 | rng.randrange(8)}
        unknown = {at.W: rng.choice(masks), at.STATUS: rng.choice((0, 0, 1, 2, 4, 7))}
        if address in (4, 8, 9):
            known[SLOTS[address]], unknown[SLOTS[address]] = rng.randrange(256), rng.choice(masks)
        differs = dict.fromkeys((at.W, at.STATUS, at.PC, SLOTS[address]), 0)
        first: dict[int, int] = {}
        chip, fresh = untracked(word)
        for values in product(*(choices(known[slot], unknown[slot]) for slot in known)):
            chip._s[:] = fresh
            for slot, value in zip(known, values, strict=True):
                chip._s[slot] = value
            chip.step()
            for slot in differs:
                differs[slot] |= int(chip._s[slot]) ^ first.setdefault(slot, int(chip._s[slot]))
        chip, fresh = powered(word)
        s = chip._s
        s[:] = fresh
        for slot, value in known.items():
            s[slot], s[slot + 1] = value, unknown[slot] | (OF_W << 8 if unknown[slot] else 0)
        chip.step()
        where = f"{name} {fields} {known} {unknown}"
        for slot, bits in differs.items():
            if slot not in (at.PCLATH, at.PC):
                assert s[slot + 1] & 0xFF == bits, where
                assert (s[slot] ^ first[slot]) & 0xFF & ~bits == 0, where
        bits, kind = USED[address]
        if address != 2 and differs[at.PC]:
            bits, kind = 0xFF, at.USE_SKIP
        assert s[at.USE_KIND] == (kind if differs[SLOTS[address]] & bits or kind == at.USE_SKIP else 0), where


# Ports ------------------------------------------------------------------------------------------------------

ALL, RA4 = 0x1FFF, 1 << 4
PORTS = {5: (0x1F, 0), 6: (0xFF << 5, 5)}
"""By address: the pins of a port, and the first of them."""


def at_the_pins(latch: int, doubt: int, tris: int, held: int, level: int) -> tuple[int, int]:
    """Return what the pins read and which of them are unknown (DS35007 sections 4.1 and 4.2).

    An input that nothing holds floats, here low; an output has its latch's level; RA4 drives low only.
    """
    driven = ~tris & ALL & ~(RA4 if latch & RA4 else 0)
    return (level & held & ~driven) | (latch & driven), (ALL & ~driven & ~held) | (doubt & driven)


@pytest.mark.parametrize("address", PORTS)
def test_what_is_known_of_a_port_after_a_write(address: int) -> None:
    """A read takes the pins, a write the latches; an unknown level is used where it is driven."""
    mine, first = PORTS[address]
    rng = random.Random(address)
    used = 0
    for name in ("MOVWF", "CLRF", "BSF", "BCF", "COMF", "IORWF") * 40:
        bit = rng.randrange(8)
        fields = {"b": bit} if name in ("BSF", "BCF") else {"d": 1} if name in ("COMF", "IORWF") else {}
        chip, fresh = powered(encode(name, f=address, **fields))
        s = chip._s
        s[:] = fresh
        latch, doubt, tris = (
            rng.getrandbits(13),
            rng.getrandbits(13) & rng.getrandbits(13),
            rng.getrandbits(13),
        )
        held, level = rng.getrandbits(13), rng.getrandbits(13)
        waiting = rng.getrandbits(13) & doubt & ~tris
        pins, open_ = at_the_pins(latch, doubt, tris, held, level & held)
        w, wu = rng.randrange(256), rng.choice((0, 0xF0, 0x81))
        for slot, value in (
            (at.LATCH, latch), (at.LATCH_UNKNOWN, doubt), (at.TRIS, tris), (at.EXT_MASK, held),
            (at.EXT_LEVEL, level & held), (at.PINS, pins), (at.PINS_UNKNOWN, open_), (at.W, w),
            (at.W_UNKNOWN, wu | OF_W << 8 if wu else 0), (at.DRIVEN_UNKNOWN, waiting),
        ):  # fmt: skip
            s[slot] = value
        chip.step()
        v, vu = (pins & mine) >> first, (open_ & mine) >> first
        value, unknown = {
            "MOVWF": (w, wu), "CLRF": (0, 0), "BSF": (v | 1 << bit, vu & ~(1 << bit)),
            "BCF": (v & ~(1 << bit), vu & ~(1 << bit)), "COMF": (v ^ 0xFF, vu),
            "IORWF": (v | w, (vu | wu) & ~(v & ~vu) & ~(w & ~wu)),
        }[name]  # fmt: skip
        latch, doubt = (latch & ~mine | value << first & mine), (doubt & ~mine | unknown << first & mine)
        where = f"{name} {bit}"
        assert (s[at.LATCH], s[at.LATCH_UNKNOWN]) == (latch, doubt), where
        assert (s[at.PINS], s[at.PINS_UNKNOWN]) == at_the_pins(latch, doubt, tris, held, level), where
        # What was driven at an unknown level before is noted as that, and waits for a known one.
        driven = unknown << first & mine & ~tris & ~waiting
        expected = (at.USE_OUTPUT, (driven & -driven).bit_length() - 1) if driven else (0, 0)
        assert (s[at.USE_KIND], s[at.USE_SUBJECT]) == expected, where
        assert s[at.DRIVEN_UNKNOWN] == waiting & (doubt | ~mine), where
        if address == 6:  # a write of port B reads it, too
            assert s[at.RB_OLD_UNKNOWN] == open_ & 0xF0 << 5
            assert (s[at.RB_OLD] ^ pins) & 0xF0 << 5 == 0
        used += bool(driven)
    assert used > 40


@pytest.mark.parametrize("name", ["TRIS", "MOVWF"])
def test_a_pin_driven_unwritten_is_forgiven_for_ten_cycles_if_it_then_is_low(name: str) -> None:
    """No servo responds to so short a pulse. It ends with another direction or a known level."""
    rng = random.Random(name)
    warned = 0
    for address in (5, 6) * 100:
        mine, first = PORTS[address]
        chip, fresh = powered(encode(name, f=address))
        s = chip._s
        s[:] = fresh
        tris, doubt, w = rng.getrandbits(13), rng.getrandbits(13) | rng.getrandbits(13), rng.randrange(256)
        waiting, now = rng.getrandbits(13) & doubt & ~tris, 1000
        since = [now - rng.randrange(8, 14) for _ in range(13)]
        s[at.CYCLE], s[at.W], s[at.W_UNKNOWN] = now, w, 0
        s[at.TRIS], s[at.LATCH_UNKNOWN], s[at.DRIVEN_UNKNOWN] = tris, doubt, waiting
        s[at.DRIVEN_FROM : at.DRIVEN_FROM + 26 : 2] = since
        chip.step()
        written = w << first & mine
        after, level = (tris & ~mine | written, 0) if name == "TRIS" else (tris, written)
        left = doubt & ~mine if name == "MOVWF" else doubt
        ended = waiting & mine & (after | ~left)
        begun = tris & ~after & left
        assert s[at.DRIVEN_UNKNOWN] == waiting & ~ended | begun
        late = sum(1 << pin for pin in range(13) if now - since[pin] > 10)
        expected = ended & (late | level & ~after)
        # A pin that waits on is late a cycle later; one that is driven from now on is not.
        expected |= waiting & ~ended & sum(1 << pin for pin in range(13) if now + 1 - since[pin] > 10)
        assert subjects(s, at.WARN_DRIVEN_UNWRITTEN) == tuple(pin for pin in range(13) if expected >> pin & 1)
        for pin in range(13):
            if begun >> pin & 1:
                assert (s[at.DRIVEN_FROM + 2 * pin], s[at.DRIVEN_FROM + 2 * pin + 1]) == (now, 0)
        warned += bool(ended & expected)
    assert warned > 40


def test_which_flags_are_in_doubt_after_a_write_of_intcon_and_which_interrupts() -> None:
    """DS35007 register 2-3: GIE 7, T0IE 5, INTE 4, RBIE 3, T0IF 2, INTF 1, RBIF 0."""
    chip, fresh = powered(encode("MOVWF", f=0x0B))
    rng = random.Random(7)
    found = {0: 0, at.USE_INTERRUPT: 0}
    for _ in range(500):
        s = chip._s
        s[:] = fresh
        option = rng.choice((0xFF, 0xF7, 0xD7))  # RA4, RA4 through the prescaler, the internal clock by 256
        w, wu = rng.randrange(256) | rng.choice((0, 0x80)), rng.choice((0, 0, 1, 2, 4, 7))
        pins, open_ = rng.getrandbits(13), rng.getrandbits(13) & rng.getrandbits(13) & rng.getrandbits(13)
        old, old_open = pins ^ (rng.choice((0, 0, 1)) << rng.randrange(9, 13)), rng.choice((0, 0, 1 << 9))
        tris, counts = rng.getrandbits(13), rng.choice((0, 0x10))
        for slot, value in (
            (at.OPTION, option), (at.W, w), (at.W_UNKNOWN, wu | OF_W << 8 if wu else 0), (at.PINS, pins),
            (at.PINS_UNKNOWN, open_), (at.RB_OLD, old & 0xFF << 5), (at.RB_OLD_UNKNOWN, old_open),
            (at.TRIS, tris), (at.TMR0, 5), (at.TMR0_UNKNOWN, counts), (at.PRESCALER_UNKNOWN, 0),
            (at.AWAKE_AT, rng.choice((0, 9))),
        ):  # fmt: skip
            s[slot] = value
        chip.step()
        compared = tris & 0xF0 << 5
        differ, possible = (pins ^ old) & compared, (open_ | old_open) & compared
        flags, doubt = w | bool(differ), wu
        if differ & ~possible:
            doubt &= ~1
        elif possible and not w & ~wu & 1:
            doubt |= 1
        if open_ & 1 << 5 and not w & ~wu & 2:
            doubt |= 2
        clocked = open_ & RA4 and option & 0x20
        if clocked and not w & ~wu & 4:
            doubt |= 4
        assert (s[at.INTCON], s[at.INTCON_UNKNOWN]) == (flags, doubt), (hex(w), wu)
        assert s[at.TMR0_UNKNOWN] & 0xFF == (0xFF if clocked else counts)
        assert s[at.PRESCALER_UNKNOWN] == (0xFF if clocked and option == 0xF7 else 0)
        enabled = w >> 3 & 7
        open_flags = enabled & doubt
        if not open_flags and enabled & 4 and s[at.TMR0_UNKNOWN] and not option & 0x20:
            open_flags = 4
        used = w & 0x80 and not enabled & flags & ~doubt and open_flags
        assert (s[at.USE_KIND], s[at.USE_SUBJECT]) == ((at.USE_INTERRUPT, open_flags) if used else (0, 0))
        requested = w & 0x80 and enabled & flags
        assert s[at.IRQ_AT] == (max(1, int(s[at.AWAKE_AT])) if requested else at.NEVER)
        found[int(s[at.USE_KIND])] += 1
    assert min(found.values()) > 60
