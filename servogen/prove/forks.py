"""Case distinctions where an unknown bit decides: choices that together cover every value of it.

In: a state, the instruction about to be executed, and which of its bits decides. Out: choices, each making
some bits known for that instruction; every chip of the state agrees with at least one of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

from servogen.pic.device import BOTH_BANKS, RAM_FIRST, RAM_LAST, addresses, masks, registers
from servogen.pic.image import Image
from servogen.pic.isa import Decoded, decode
from servogen.prove.chip import CELL_MASK_SHIFT, CELL_PHASED, UNCERTAIN, WRITTEN, AssumedBits, ChipState, Use
from servogen.simulator import layout

INDF, TMR0, STATUS, PORTA = addresses("INDF", "TMR0", "STATUS", "PORTA")
PORTB, EEDATA, INTCON = addresses("PORTB", "EEDATA", "INTCON")
(RP0,) = masks("RP0")
B_SHIFT = 5
MAX_CHOICES = 10
"""Bits that may decide one instruction; more are not told apart."""
MAX_TIMER_BITS = 12
"""Unknown bits of TMR0 and its prescaler; with more, its values are not told apart."""

Choices = tuple[AssumedBits, ...]

ALONE = AssumedBits("INTCON", 0, 0)
"""Chooses nothing: the next instruction is executed alone."""
RD, WR, BANK_1 = 0, 1, 0x80
"""The bits of EECON1 that start a read and a write; the bit of FSR that selects bank 1."""

_FIELDS = {registers()[row.register].address: name for name, row in UNCERTAIN.items() if row.register}
"""The registers whose bits may be unknown, by address with the bank in bit 7; those of both banks by the
lower one."""
_IN_BOTH_BANKS = frozenset(addresses(*BOTH_BANKS))


@dataclass(frozen=True)
class PreparedProgram:
    """What the prover must know of a program's words before it runs them."""

    image: Image
    any_write_time: bool = True
    """Whether an EEPROM write may end in any cycle."""
    tells_timers: bool = False
    """Whether an unknown TMR0 that will interrupt is told apart; the checker of certificates cannot."""

    def at(self, pc: int) -> Decoded | None:
        """Return the decoded instruction at an address; None if there is none."""
        word = self.image.program.get(pc & 0x3FF)
        return None if word is None else decode(word)

    @property
    def choice_points(self) -> frozenset[int]:
        """Return the addresses of instructions before which a search has to choose something."""
        return self.port_reads() | self.option_writes() | self.sleeps | self.eeprom_accesses

    def port_reads(self) -> frozenset[int]:
        """Return the addresses of instructions that read a port without writing it."""
        addresses = set()
        for address in self.image.program:
            decoded = self.at(address)
            if decoded is None or decoded.f not in (PORTA, PORTB) or "f" not in decoded.instruction.reads:
                continue
            if decoded.instruction.writes == "" or (decoded.instruction.writes == "d" and not decoded.d):
                addresses.add(address)
        return frozenset(addresses)

    def option_writes(self) -> frozenset[int]:
        """Return the addresses of instructions that may write OPTION_REG, except through INDF."""
        addresses = set()
        for address in self.image.program:
            decoded = self.at(address)
            if decoded is None:
                continue
            row = decoded.instruction
            writes = row.writes == "f" or (row.writes == "d" and decoded.d)
            if row.mnemonic == "OPTION" or (writes and "f" in row.operands and decoded.f == TMR0):
                addresses.add(address)
        return frozenset(addresses)

    @cached_property
    def sleeps(self) -> frozenset[int]:
        """Return the addresses of SLEEP."""
        return frozenset(a for a, decoded in self._words() if decoded.instruction.mnemonic == "SLEEP")

    @cached_property
    def eeprom_accesses(self) -> frozenset[int]:
        """Return the addresses that may access EECON1; none if no word that names it may set WR."""
        named = {a: decoded for a, decoded in self._words() if _names(decoded, EEDATA)}
        if not any(_may_set_wr(decoded) for decoded in named.values()):
            return frozenset()
        return frozenset({*named} | {a for a, decoded in self._words() if _names(decoded, INDF)})

    def accesses(self, register: int, writing: bool = False) -> frozenset[int]:
        """Return the addresses that access a register by its name, or only those that write it."""
        return frozenset(
            address
            for address, decoded in self._words()
            if _names(decoded, register) and (not writing or decoded.instruction.writes_file(decoded.d))
        )

    @cached_property
    def entries(self) -> frozenset[int]:
        """Return the addresses of subroutines, and those to which they return."""
        calls = [(a, decoded.k) for a, decoded in self._words() if decoded.instruction.mnemonic == "CALL"]
        return frozenset(target & 0x3FF for a, k in calls for target in (a + 1, k))

    def reads_eeprom(self, state: ChipState) -> bool:
        """Return whether the next instruction may set RD of EECON1."""
        decoded = self.at(state["PC"])
        if decoded is None or not (_in_eecon1(decoded, state)):
            return False
        row = decoded.instruction
        if row.changes_bit:
            return row.mnemonic == "BSF" and decoded.b == RD
        clear = row.mnemonic == "MOVWF" and not (state["W"] | state["W_UNKNOWN"]) >> RD & 1
        return row.writes_file(decoded.d) and not clear

    def _words(self) -> Iterator[tuple[int, Decoded]]:
        for address in self.image.program:
            decoded = self.at(address)
            if decoded is not None:
                yield address, decoded


def _names(decoded: Decoded, register: int) -> bool:
    return "f" in decoded.instruction.operands and decoded.f == register


def _may_set_wr(decoded: Decoded) -> bool:
    row = decoded.instruction
    return decoded.b == WR and row.mnemonic == "BSF" if row.changes_bit else row.writes_file(decoded.d)


def _in_eecon1(decoded: Decoded, state: ChipState) -> bool:
    """Return whether an instruction accesses EECON1, or may through INDF."""
    if _names(decoded, INDF):
        return bool(state["FSR_UNKNOWN"]) or state["FSR"] == BANK_1 | EEDATA
    return bool(state["STATUS"] & RP0) and _names(decoded, EEDATA)


def before_instruction(
    program: PreparedProgram, state: ChipState, sampled: frozenset[int], phases: int
) -> list[Choices]:
    """Return the ways to execute the next instruction, if it reads pins, writes OPTION_REG, sleeps, or
    accesses EECON1; else one, empty.

    Levels of `sampled` pins are told apart wherever they are read. `phases`: in how many ways TMR0 may begin.
    """
    decoded = program.at(state["PC"])
    if decoded is None:
        return [()]
    bank_1 = bool(state["STATUS"] & RP0)
    row = decoded.instruction
    if row.mnemonic == "SLEEP" or _in_eecon1(decoded, state):
        # The write in progress may be over already, or not yet: EECON1 reads differently, and SLEEP with EEIF
        # set and enabled is a NOP.
        writing = state["EE_DONE_AT"] != layout.NEVER and program.any_write_time
        return [(ALONE,), (AssumedBits("EE_DONE", 0, 0),)] if writing else [(ALONE,)]
    if row.mnemonic == "OPTION" or (decoded.f == TMR0 and bank_1 and _writes(decoded)):
        return [(AssumedBits("TMR0_PHASE", 0, phase),) for phase in range(phases)]
    if bank_1 or decoded.f not in (PORTA, PORTB) or "f" not in row.reads or _writes(decoded):
        return [()]
    shift = 0 if decoded.f == PORTA else B_SHIFT
    unknown_pins = state["PINS_UNKNOWN"]
    if "b" in row.operands:
        pins = [decoded.b + shift]
    else:
        pins = [pin for pin in sorted(sampled) if shift <= pin < (B_SHIFT if shift == 0 else 13)]
    ways: list[Choices] = [()]
    for pin in pins:
        if unknown_pins >> pin & 1:
            ways = [
                (*chosen, AssumedBits("PINS", 1 << pin, level << pin)) for chosen in ways for level in (0, 1)
            ]
    return ways


def _writes(decoded: Decoded) -> bool:
    row = decoded.instruction
    return "f" in row.operands and (row.writes == "f" or (row.writes == "d" and bool(decoded.d)))


def ways_of_latches(state: ChipState, pins: int) -> list[Choices]:
    """Return the ways in which the latches of `pins` may be, as far as they are not known."""
    mask = state["LATCH_UNKNOWN"] & pins
    if not mask:
        return [()]
    bits = [1 << pin for pin in range(mask.bit_length()) if mask >> pin & 1]
    values = [sum(chosen) for chosen in product(*((0, bit) for bit in bits))]
    return [(AssumedBits("LATCH", mask, value),) for value in values]


def ways_of(program: PreparedProgram, state: ChipState, use: Use, chosen: Choices) -> list[Choices] | None:
    """Return the ways beyond `chosen` in which the unknown bit that decides may be; None if they are not
    known.
    """
    if len(chosen) >= MAX_CHOICES:
        return None
    if use.kind == layout.USE_INTERRUPT and use.subject & layout.T0IF and state["TMR0_UNKNOWN"]:
        if not program.tells_timers:
            return None  # when TMR0 overflows is unknown, and so is the time of its interrupt
        mask = _unknown_mask(state, "TMR0")
        return [(*chosen, AssumedBits("TIMER", mask, value)) for value in range(256) if not value & ~mask]
    if use.kind == layout.USE_INTERRUPT:
        flags = [1 << bit for bit in range(3) if use.subject >> bit & 1]
        # A pin may set its flag before the instruction, or in the second cycle of one that takes two.
        ways = [AssumedBits(field, flag, flag) for flag in flags for field in ("INTCON", "INTCON_LATE")]
        ways += [AssumedBits("EE_DONE", 0, late) for late in (0, 1) if use.subject & WRITTEN]
        return [(*chosen, event) for event in (AssumedBits("INTCON", use.subject & 7, 0), *ways)]
    decoded = program.at(state["PC"])
    if decoded is None:
        return None
    if use.kind == layout.USE_SKIP and program.tells_timers and _tests_overflow(decoded, state):
        return [(*chosen, *timer) for timer in _timers(state)]
    if use.kind == layout.USE_WAKE:
        flags = [1 << bit for bit in range(3) if use.subject >> bit & 1]
        return [(*chosen, AssumedBits("INTCON", use.subject, value)) for value in (0, *flags)]
    for field in _operands(decoded, state, use):
        mask = _unknown_mask(state, field) & ~sum(choice.bits for choice in chosen if choice.field == field)
        if use.kind == layout.USE_SKIP and "b" in decoded.instruction.operands:
            mask &= _bit_of(decoded, field)
        if not mask:
            continue
        if decoded.instruction.writes and field.startswith("0x") and use.kind == layout.USE_SKIP:
            return _counted(decoded, state, field, chosen)
        # One bit at a time: often the first one decides alone, and otherwise the run stops here again.
        bit = mask & -mask
        return [(*chosen, AssumedBits(field, bit, value)) for value in (0, bit)]
    return None


def _tests_overflow(decoded: Decoded, state: ChipState) -> bool:
    """Return whether a skip depends on T0IF, and T0IF on where an internal clock has brought TMR0."""
    of_intcon = decoded.f == INTCON and "b" in decoded.instruction.operands
    of_overflow = of_intcon and 1 << decoded.b == layout.T0IF
    return of_overflow and bool(state["TMR0_UNKNOWN"] & 0xFF) and not state["OPTION"] & layout.T0CS


def _timers(state: ChipState) -> list[Choices]:
    """Return each value that TMR0 and its prescaler may have, where they are not too many, with T0IF."""
    flags = [AssumedBits("INTCON", layout.T0IF, flag) for flag in (0, layout.T0IF)]
    masks = {"TIMER": _unknown_mask(state, "TMR0")}
    if not state["OPTION"] & layout.PSA:
        masks["PRESCALER"] = state["PRESCALER_UNKNOWN"] & (2 << (state["OPTION"] & layout.PS)) - 1
    if sum(mask.bit_count() for mask in masks.values()) > MAX_TIMER_BITS:
        return [(flag,) for flag in flags]
    every = [
        [AssumedBits(field, mask, value) for value in range(256) if not value & ~mask]
        for field, mask in masks.items()
    ]
    return [*product(*every, flags)]


def _bit_of(decoded: Decoded, field: str) -> int:
    shift = B_SHIFT if field == "PINS" and decoded.f == PORTB else 0
    return 1 << decoded.b + shift


def _operands(decoded: Decoded, state: ChipState, use: Use) -> list[str]:
    """Return the fields that an instruction depends on, the most likely first."""
    if use.kind == layout.USE_POINTER:
        return ["FSR"]
    row = decoded.instruction
    names = []
    if "f" in row.operands and "f" in row.reads:
        names += _field_of(decoded.f, state)
    if "W" in row.reads:
        names.append("W")
    if "C" in row.reads:
        names.append("STATUS")
    return names


def _field_of(f: int, state: ChipState) -> list[str]:
    bank_1 = bool(state["STATUS"] & RP0)
    if f == INDF:
        if state["FSR_UNKNOWN"]:
            return []
        f, bank_1 = state["FSR"] & 0x7F, bool(state["FSR"] & 0x80)
    if RAM_FIRST <= f <= RAM_LAST:
        return [f"0x{f:02X}"]
    if f in (PORTA, PORTB) and not bank_1:
        return ["PINS"]
    address = f | BANK_1 if bank_1 and f not in _IN_BOTH_BANKS else f
    return [_FIELDS[address]] if address in _FIELDS else []


def _unknown_mask(state: ChipState, field: str) -> int:
    if field.startswith("0x"):
        cell = state.ram[int(field, 16) - RAM_FIRST]
        return 0xFF if cell >= CELL_PHASED else cell >> CELL_MASK_SHIFT
    if field == "PINS":
        return state["PINS_UNKNOWN"]
    return state[UNCERTAIN[field].unknown_name] & 0xFF


def _counted(decoded: Decoded, state: ChipState, field: str, chosen: Choices) -> list[Choices]:
    """Return the ways of DECFSZ and INCFSZ: the byte that becomes 0, and all others, not told apart."""
    cell = state.ram[int(field, 16) - RAM_FIRST]
    last = 1 if decoded.instruction.mnemonic == "DECFSZ" else 0xFF
    mask = 0xFF if cell >= CELL_PHASED else cell >> CELL_MASK_SHIFT
    # Any value other than `last` stands for all others: the result is not 0, so the skip is not taken.
    # `steer` leaves the byte unknown.
    other = last ^ (mask & -mask)
    return [
        (*chosen, AssumedBits(field, 0xFF, last)),
        (*chosen, AssumedBits(field, 0xFF, other, steer=True)),
    ]
