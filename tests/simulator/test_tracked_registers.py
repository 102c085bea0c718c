"""What is unknown after writes of registers, ports and the EEPROM, and what depends on it at once.

By every choice of the unknown bits, executed by a chip that tracks nothing, or by a formula.
"""

from __future__ import annotations

import random
from functools import cache
from itertools import product

import numpy as np
import pytest

from servogen.pic.device import registers
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import LevelChange, Machine, Recorded, Stimuli
from servogen.simulator import layout as at
from servogen.simulator.warnings import subjects
from tests.simulator.helpers import CLOCK
from tests.simulator.test_propagation import OF_C, OF_F, OF_W, ON_FILE, choices, powered

# Special function registers ---------------------------------------------------------------------------------

ROWS = {
    registers()[row.register].address: row for row in at.ROWS if row.register not in ("", "TMR0", "INTCON")
}
SLOTS = {address: row.number for address, row in ROWS.items() if address < 0x80}
"""By address in bank 0; what else a write of TMR0, INTCON and bank 1 does is below."""
USED = {3: (0x20, at.USE_BANK), 0x0A: (0x1F, at.USE_REGISTER), 0x02: (0xFF, at.USE_JUMP)}
"""The bits of a register on which something depends at once, and what."""


@cache
def untracked(word: int) -> tuple[Machine, np.ndarray]:
    chip = Machine(Image({0: word}, 0x3FF1), CLOCK)
    return chip, chip.numbers.copy()


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
        if ROWS[address].is_free:
            known[SLOTS[address]], unknown[SLOTS[address]] = rng.randrange(256), rng.choice(masks)
        differs = dict.fromkeys((at.W, at.STATUS, at.PC, SLOTS[address]), 0)
        first: dict[int, int] = {}
        chip, fresh = untracked(word)
        for values in product(*(choices(known[slot], unknown[slot]) for slot in known)):
            chip.numbers[:] = fresh
            for slot, value in zip(known, values, strict=True):
                chip.numbers[slot] = value
            chip.step()
            for slot in differs:
                differs[slot] |= int(chip.numbers[slot]) ^ first.setdefault(slot, int(chip.numbers[slot]))
        chip, fresh = powered(word)
        s = chip.numbers
        s[:] = fresh
        for slot, value in known.items():
            s[slot], s[slot + 1] = value, unknown[slot] | (OF_W << 8 if unknown[slot] else 0)
        chip.step()
        where = f"{name} {fields} {known} {unknown}"
        for slot, bits in differs.items():
            if slot not in (at.PCLATH, at.PC):
                assert s[slot + 1] & 0xFF == bits, where
                assert (s[slot] ^ first[slot]) & 0xFF & ~bits == 0, where
        bits, kind = USED.get(address, (0, 0))
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
        s = chip.numbers
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
        s = chip.numbers
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


@pytest.mark.parametrize("any_input", [0, 1])
def test_pull_ups_hold_what_nothing_else_does(any_input: int) -> None:
    """RBPU, bit 7 of OPTION_REG, clear: those of port B are on. A board may have one at RA4.

    For the prover any input may be driven against its pull-up.
    """
    chip, fresh = powered(encode("TRIS", f=6))
    rng = random.Random(any_input)
    for _ in range(200):
        s = chip.numbers
        s[:] = fresh
        option, pulled, floating = rng.choice((0x7F, 0xFF)), rng.randrange(2), rng.choice((0, ALL))
        latch, doubt, w = rng.getrandbits(13), rng.getrandbits(13) & rng.getrandbits(13), rng.randrange(256)
        tris, held, level = rng.getrandbits(13), rng.getrandbits(13), rng.getrandbits(13)
        for slot, value in (
            (at.OPTION, option), (at.RESISTORS, RA4 * pulled), (at.FLOATING, floating), (at.LATCH, latch),
            (at.LATCH_UNKNOWN, doubt), (at.TRIS, tris), (at.EXT_MASK, held), (at.EXT_LEVEL, level & held),
            (at.W, w), (at.W_UNKNOWN, 0), (at.ANY_INPUT, any_input),
        ):  # fmt: skip
            s[slot] = value
        chip.step()
        tris = tris & 0x1F | w << 5
        up = (0xFF << 5 if option == 0x7F else 0) | (RA4 if pulled else 0)
        driven = ~tris & ALL & ~(RA4 if latch & RA4 else 0)
        resting = level & held | (floating | up) & ~held
        assert s[at.PINS] == latch & driven | resting & ~driven
        assert s[at.PINS_UNKNOWN] == ALL & ~driven & ~held & ~(0 if any_input else up) | doubt & driven


def test_which_flags_are_in_doubt_after_a_write_of_intcon_and_which_interrupts() -> None:
    """DS35007 register 2-3: GIE 7, T0IE 5, INTE 4, RBIE 3, T0IF 2, INTF 1, RBIF 0."""
    chip, fresh = powered(encode("MOVWF", f=0x0B))
    rng = random.Random(7)
    found = {0: 0, at.USE_INTERRUPT: 0}
    for _ in range(500):
        s = chip.numbers
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


# EEPROM and TMR0 --------------------------------------------------------------------------------------------

EEIF, WRERR, WREN, WR, RD = 0x10, 0x08, 0x04, 0x02, 0x01
"""DS35007 register 3-1."""


def test_a_write_of_eecon1_starts_a_write_or_a_read_of_the_eeprom() -> None:
    """A write needs WREN from before, and the two keys, the second in the cycle before (section 3.2)."""
    chip, fresh = powered(encode("MOVWF", f=0x08))
    rng = random.Random(8)
    begun = 0
    for _ in range(500):
        s = chip.numbers
        s[:] = fresh
        now, before = 1000, rng.choice((0, WREN, WREN, WREN | EEIF, WREN | WR, WRERR))
        w, wu = rng.randrange(32) | rng.choice((0, WR)), rng.choice((0, 0, 0, WRERR, EEIF, WREN, WR, RD))
        step, ago, address = (
            rng.choice((0, 1, 2, 2, 2)),
            rng.choice((0, 1, 1, 1, 2)),
            rng.choice((5, 63, 64, 255)),
        )
        address_open, data, data_open = rng.choice((0, 0, 0x01)), rng.randrange(256), rng.choice((0, 0, 0x80))
        done = now + 77 if before & WR else at.NEVER
        s[at.EEPROM : at.EEPROM + 64] = range(100, 164)
        for slot, value in (
            (at.CYCLE, now), (at.STATUS, 0x38), (at.STATUS_UNKNOWN, 0), (at.W, w),
            (at.W_UNKNOWN, wu | OF_W << 8 if wu else 0), (at.EECON1, before), (at.EE_STEP, step),
            (at.EE_STEP_AT, now - ago), (at.EEADR, address), (at.EEDATA, data), (at.EE_DONE_AT, done),
            (at.EEADR_UNKNOWN, address_open | OF_F << 8 if address_open else 0),
            (at.EEDATA_UNKNOWN, data_open | OF_C << 8 if data_open else 0),
        ):  # fmt: skip
            s[slot] = value
        chip.step()
        asked = bool(w & WR and not before & WR)
        starts = asked and bool(before & WREN) and step == 2 and ago == 1
        assert s[at.EECON1] == w & (EEIF | WRERR | WREN) | before & WR | (WR if starts else 0)
        assert s[at.EECON1_UNKNOWN] == wu & WRERR
        assert s[at.EE_DONE_AT] == (now + 1 + s[at.EE_TIME] if starts else done)
        assert s[at.EE_STEP] == (0 if asked else step)
        if starts:
            assert (s[at.EE_CELL], s[at.EE_BYTE]) == (address, data)
        if w & RD:
            open_ = at.SOURCE_NO_CELL if address > 63 else at.SOURCE_EEADR if address_open else 0
            assert s[at.EEDATA] == (100 + address if address < 64 else 0)
            assert s[at.EEDATA_UNKNOWN] == (0xFF | open_ << 8 if open_ else 0)
        else:
            assert (s[at.EEDATA], s[at.EEDATA_UNKNOWN] & 0xFF) == (data, data_open)
        expected = (
            (at.USE_EEPROM, 0, OF_F if address_open else OF_C)
            if starts and address_open | data_open
            else (0, 0, 0)
        )
        expected = (at.USE_REGISTER, 0x88, OF_W) if wu & ~WRERR else expected
        assert (s[at.USE_KIND], s[at.USE_SUBJECT], s[at.USE_SOURCE]) == expected
        assert subjects(s, at.WARN_EE_SEQUENCE) == ((0,) if asked and not starts else ())
        assert subjects(s, at.WARN_EE_ADDRESS) == ((address,) if w & RD and address > 63 else ())
        begun += starts
    assert begun > 60


@pytest.mark.parametrize("option", [0xD8, 0xD0, 0xD1, 0xD5, 0xD7])
def test_t0if_is_in_doubt_from_the_first_increment_on_that_could_overflow_an_unknown_count(
    option: int,
) -> None:
    """It is seen a cycle before TMR0 is read as 0 (DS30430 figure 6-4). PSA, bit 3, takes the prescaler away;
    its divisor is 2 to 256 (DS35007 register 2-2), and it may be unknown itself.
    """
    chip = Machine(Image({0: encode("NOP"), 1: encode("GOTO", k=0)}, 0x3FF1), CLOCK, tracked=True)
    fresh = chip.numbers.copy()
    divisor = 1 if option & 8 else 2 << (option & 7)
    for count, count_open in ((0, 0), (divisor - 1, 0), (divisor // 2, 0), (0, divisor - 1), (0, divisor)):
        due = 0 if count_open & (divisor - 1) else divisor - count % divisor - 1
        for cycle in {max(0, due - 2), max(0, due - 1), due, due + 1, due + 2}:
            s = chip.numbers
            s[:] = fresh
            s[at.OPTION], s[at.TMR0], s[at.TMR0_UNKNOWN] = option, 0x40, 0xFF
            s[at.PRESCALER], s[at.PRESCALER_UNKNOWN], s[at.INTCON_UNKNOWN] = count, count_open, 0
            chip.run(cycle)
            assert bool(s[at.INTCON_UNKNOWN] & 4) == (chip.cycles >= due), (count, count_open, cycle)


@pytest.mark.parametrize("option", [0x28, 0x20, 0x21, 0x25, 0x27, 0x2F])
def test_an_unknown_count_of_the_prescaler_makes_tmr0_unknown_where_it_divides_its_clock(option: int) -> None:
    """T0CS is set, and a board holds RA4."""
    chip, fresh = powered(encode("MOVWF", f=0x01))
    divides = 0 if option & 8 else (2 << (option & 7)) - 1
    for count_open in (0, *(1 << bit for bit in range(8))):
        s = chip.numbers
        s[:] = fresh
        s[at.STATUS], s[at.STATUS_UNKNOWN], s[at.W], s[at.W_UNKNOWN] = 0x38, 0, option, 0
        s[at.EXT_MASK], s[at.PINS_UNKNOWN] = 1 << 4, 0x1FEF
        s[at.PRESCALER_UNKNOWN], s[at.TMR0], s[at.TMR0_UNKNOWN] = count_open, 7, 0
        chip.step()
        assert s[at.OPTION] == option
        open_ = 0xFF | at.SOURCE_PRESCALER << 8 if count_open & divides else 0
        assert (s[at.TMR0_UNKNOWN], s[at.PRESCALER_UNKNOWN]) == (open_, count_open)


def test_what_is_unknown_after_a_reset_by_mclr() -> None:
    """DS35007 table 6-4: pins become inputs, enables 0, RBIF is kept; a write of the EEPROM breaks off."""
    program = Image({0: encode("NOP"), 1: encode("GOTO", k=0)}, 0x3FF1)
    pulse = Stimuli([Recorded([LevelChange(10, 13, 0)])])
    for held, rbif, rbif_open, writing in product((0, 0x1FFF), (0, 1), (0, 1), (False, True)):
        chip = Machine(program, CLOCK, stimulus=pulse, tracked=True)
        chip.run(8)
        s = chip.numbers
        s[at.EXT_MASK], s[at.EXT_LEVEL], s[at.PINS], s[at.RB_OLD] = held, held, held, held & 0x1FE0
        s[at.PINS_UNKNOWN] = s[at.RB_OLD_UNKNOWN] = 0x1FE0 & ~held
        s[at.INTCON], s[at.INTCON_UNKNOWN] = 0x70 | rbif, 6 | rbif_open
        s[at.TMR0_UNKNOWN], s[at.PRESCALER_UNKNOWN], s[at.EECON1_UNKNOWN] = 0, 0xFF, 0x08
        s[at.EE_DONE_AT] = 5000 if writing else at.NEVER
        chip.run(4)
        assert (s[at.IN_RESET], s[at.PC], s[at.INTCON] & ~7) == (1, 0, 0)
        assert s[at.PINS_UNKNOWN] == 0x1FFF & ~held
        open_ = rbif_open if held else 6 | (not rbif or rbif_open)
        assert (s[at.INTCON] & 1, s[at.INTCON_UNKNOWN]) == (rbif, open_)
        assert s[at.TMR0_UNKNOWN] == (0 if held else 0xFF | at.FLOATING_PIN + 4 << 8)
        assert s[at.PRESCALER_UNKNOWN] == 0
        assert s[at.EECON1_UNKNOWN] == (0 if writing else 0x08)
        assert s[at.EECON1] & 0x08 == (0x08 if writing else 0)
