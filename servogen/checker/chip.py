"""The chip with unknown bits, compiled by numba: runs a program from one state to the next event.

In: a vector of integers (the state), the program, the edges expected in this frame. Out: the state later,
and the reason why it stopped. A byte is a cell v | m << 8 | p << 16: the bits of m are unknown (and 0 in v);
if p is 1, the byte is v + φ mod 256, with one φ for all such bytes, the unknown phase of TMR0.
Sources: DS35007 sections 2 to 7; DS30430 figures 6-2 to 6-4 and 8-17.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numba import njit

from servogen.pic.image import Image
from servogen.pic.isa import decode

Ints = npt.NDArray[np.int64]
F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Mark `function` to be compiled; the machine code is kept beside the source, or in the user's cache."""
    try:
        return cast(F, njit(cache=True, error_model="numpy")(function))
    except RuntimeError:  # neither can be written
        return cast(F, njit(error_model="numpy")(function))


# Slots of the state: a register of bank 0 at its address (ports: the latch), one of bank 1 at 0x50 + address.
NOWHERE, T0, PCL, STATUS, FSR, PORTA, PORTB = range(7)
EEDATA, EEADR, PCLATH, INTCON, RAM, RAM_END = 8, 9, 10, 11, 12, 0x50
BANK_1 = W = 0x50
OPTION, TRISA, TRISB, EECON1 = 0x51, 0x55, 0x56, 0x58
(PC, DEPTH, CYCLE, T0_FROM, T0_ZERO, T0_DUE, IRQ, CLEARED, WDT_DUE, DARK, FRAME, EDGE, NEXT_EVENT,
 GIVEN, ASKED, ASKED_BIT, STACK) = range(0x60, 0x71)  # fmt: skip
SLOTS = STACK + 8
UNKNOWN = 0xFF00
NEVER = 1 << 60
BEFORE = -NEVER
"""`FRAME`, the cycle in which the frame began, before the first pulse."""


class RegisterSlot(NamedTuple):
    """A slot that programs can access, and its column in certificates."""

    slot: int
    column: str
    reset: int
    """After any reset (DS35007 table 6-4)."""
    unknown: int = 0
    """The bits that may be unknown; 0 of a number, which is not a cell."""
    largest: int = 0
    """The largest value of a number."""
    moves: bool = False
    """Whether it may move with φ."""
    both_banks: bool = False


REGISTERS = (
    RegisterSlot(W, "w", UNKNOWN, unknown=0xFF, moves=True),
    RegisterSlot(STATUS, "status", 0x1F00, unknown=0xFF, both_banks=True),  # TO and PD differ between resets
    RegisterSlot(FSR, "fsr", UNKNOWN, unknown=0xFF, moves=True, both_banks=True),
    RegisterSlot(PORTA, "porta", 0x1F00, unknown=0x1F),
    RegisterSlot(PORTB, "portb", UNKNOWN, unknown=0xFF),
    RegisterSlot(EEDATA, "eedata", UNKNOWN, unknown=0xFF, moves=True),
    RegisterSlot(EEADR, "eeadr", UNKNOWN, unknown=0xFF, moves=True),
    RegisterSlot(PCLATH, "pclath", 0, unknown=0x1F, both_banks=True),
    RegisterSlot(INTCON, "intcon", 0, unknown=0x07, both_banks=True),
    RegisterSlot(EECON1, "eecon1", 0x0800, unknown=0x08),
    RegisterSlot(T0, "tmr0", UNKNOWN, unknown=0xFF, moves=True),
    RegisterSlot(OPTION, "option", 0xFF, largest=0xFF),
    RegisterSlot(TRISA, "trisa", 0x1F, largest=0x1F),
    RegisterSlot(TRISB, "trisb", 0xFF, largest=0xFF),
)
"""Cells first, of these TMR0 last."""
READ, WRITTEN = 1, 2
"""What `run` notes of W and each byte of RAM: that it was read before it was written; that it was written."""

REASONS = (
    "cut", "frame", "fork", "button", "the frame's last edge", "interrupted", "the cycle limit",
    "an edge that is not expected", "a missing edge", "a word that is not an instruction",
    "a stack of more than eight levels", "a return with an empty stack", "SLEEP", "an EEPROM write or EEIF",
    "an unknown value in a register", "control that depends on TMR0's phase",
    "an interrupt that depends on unknown values", "a watchdog that may time out",
    "a pin whose level is unknown or not driven",
)  # fmt: skip
(CUT, NEW_FRAME, FORK, BUTTON, LAST_EDGE, INTERRUPTED, TOO_LONG, WRONG_EDGE, MISSING, NO_WORD, OVERFLOW,
 EMPTY, SLEEPS, EEPROM_WRITE, REGISTER, PHASE, INTERRUPT, WATCHED, DARK_PIN) = range(19)  # fmt: skip
GOES_ON = -1

OPERATIONS: dict[str, Callable[[Ints, Ints], Ints]] = {
    "ADD": lambda a, x: a + x,
    "SUB": lambda a, x: a + (x ^ 0xFF) + 1,
    "AND": lambda a, x: a & x,
    "IOR": lambda a, x: a | x,
    "XOR": lambda a, x: a ^ x,
    "COM": lambda a, x: ~a,
    "DEC": lambda a, x: a - 1,
    "INC": lambda a, x: a + 1,
    "CLR": lambda a, x: 0 * a,
    "MOV": lambda a, x: a,
    "MOVWF": lambda a, x: x,
    "RLF": lambda a, x: a << 1 | x,
    "RRF": lambda a, x: a >> 1 | x << 7 | (a & 1) << 8,
    "SWA": lambda a, x: a >> 4 | a << 4,
    "BCF": lambda a, x: a & ~x,
    "BSF": lambda a, x: a | x,
    "BTFSC": lambda a, x: a & x,
    "BTFSS": lambda a, x: ~a & x,
}
"""By mnemonic, or its first three letters: the result of the register or literal `a`; bit 8 is the carry.
`x` is W, the carry, or the bit of the instruction. Skips are taken if the result is 0.
"""
SAME_AS = {"RETLW": "MOV", "RETFIE": "BSF", "TRIS": "MOVWF", "OPTION": "MOVWF"}
C, DC, Z, RP0, TO_PD = 1, 2, 4, 0x20, 0x18
GIE, INTE, RBIE, T0IE, T0IF = 0x80, 0x10, 0x08, 0x20, 0x04
T0CS, PSA, PS = 0x20, 0x08, 0x07
GLITCH = 10
"""Cycles for which a pin may be driven with an unknown level before the first pulse."""

FLOWS = ["undefined", "next", "skip", "jump", "call", "return", "CLRWDT", "SLEEP"]
NO_FLOW, NEXT, SKIP, JUMP, CALL, RETURN, CLRWDT, SLEEP = range(8)
FLOW, OP, ADDRESS, SLOT, READS_F, K, X, FLAGS, TO_W, TO_F, IS_CUT = range(11)
"""The columns of the decoded program: `ADDRESS` is the file register's, -1 if it has none or `SLOT` is it;
`X` is a number, or one of these:
"""
X_IS_W, X_IS_CARRY = -1, -2
MEMO, SPREAD = 1 << 16, 0x2545F4914F6CDD1D


class ChipMemory(NamedTuple):
    """What the chip holds, and tables."""

    code: Ints
    eeprom: Ints
    results: npt.NDArray[np.int16]
    """By operation, `x` and `a`: the result, and the flags from bit 8 on."""
    slots: Ints
    """Of each address, with the bank in bit 7."""
    memo: Ints
    """Results of unknown operands."""


class ChipSurroundings(NamedTuple):
    """What is around the chip. Pins are bits of a word."""

    limit: int
    """In this cycle a run must have come to a cut."""
    period: int
    channels: int
    """The pins with servos."""
    buttons: int
    held: int
    """Pins that are held, at these levels."""
    levels: int
    watchdog: int
    """The shortest period of the watchdog in cycles; 0 if it is off."""


def program_code(image: Image, cuts: frozenset[int]) -> Ints:
    """Return the program decoded; runs stop at `cuts`."""
    code = np.zeros((1024, IS_CUT + 1), dtype=np.int64)
    for address, word in image.program.items():
        decoded = decode(word)
        if decoded is None:
            continue
        row = decoded.instruction
        name = SAME_AS.get(row.mnemonic, row.mnemonic)
        name = name if name in OPERATIONS else name[:3] if name[:3] in OPERATIONS else "CLR"
        carry, from_w = "C" in row.reads, "W" in row.reads
        slot = {"RETFIE": INTCON, "OPTION": OPTION, "TRIS": decoded.f + BANK_1}.get(row.mnemonic, NOWHERE)
        code[address] = (
            FLOWS.index(row.mnemonic if row.mnemonic in FLOWS else row.flow),
            list(OPERATIONS).index(name),
            decoded.f if "f" in row.operands and not slot else -1,
            slot,
            "f" in row.reads or row.mnemonic == "RETFIE",
            decoded.k,
            X_IS_CARRY if carry else X_IS_W if from_w else GIE if slot == INTCON else 1 << decoded.b,
            sum(bit for flag, bit in (("C", C), ("D", DC), ("Z", Z)) if flag in row.flags),
            row.writes_w(decoded.d),
            row.writes_file(decoded.d) or slot,
            address in cuts,
        )
    return code


@cache
def result_table() -> npt.NDArray[np.int16]:
    """Return the results of all operations."""
    x, a = np.indices((256, 256))
    table = np.zeros((len(OPERATIONS), 256, 256), dtype=np.int16)
    for number, (name, operation) in enumerate(OPERATIONS.items()):
        r = operation(a, x)
        half_carry = (a ^ x ^ r) >> 4 & 1 ^ (name == "SUB")  # it adds the complement of x
        table[number] = r & 0xFF | (r >> 8 & C | half_carry * DC | (r & 0xFF == 0) * Z) << 8
    return table


def slot_table() -> Ints:
    """Return the slot of each address: a register of both banks, or of one; NOWHERE for those without."""
    slots = np.full(256, NOWHERE)
    for row in REGISTERS:
        if row.slot != W:
            slots[row.slot if row.slot < BANK_1 else row.slot - BANK_1 | 0x80] = row.slot
    both = [row.slot for row in REGISTERS if row.both_banks]
    for low in (PCL, *both, *range(RAM, RAM_END)):
        slots[[low, low | 0x80]] = low
    return slots


@compiled
def joined(table: npt.NDArray[np.int16], a: int, x: int) -> int:
    """Return what the results have in common over all choices of the unknown bits and φ of cells `a` and `x`:
    a cell, from bit 24 on the flags, and from bit 32 on the unknown flags.
    """
    every, some, moves = -1, 0, (a | x) >> 16 == 1
    first = 0
    mask = a >> 8 & 0xFF | x & UNKNOWN
    choice = mask
    while True:
        choice = choice - mask & mask  # the next of the subsets of `mask`, the empty one first
        for phase in range(256 if (a | x) >> 16 else 1):
            low = (a + phase if a >> 16 else a | choice) & 0xFF
            word = table[(x + phase if x >> 16 else x | choice >> 8) & 0xFF, low]
            first = word & 0xFF if every == -1 else first
            every, some = every & word, some | word
            moves = moves and word - phase & 0xFF == first
        if choice == mask:
            break
    doubt = every ^ some
    r = first | 1 << 16 if moves else every & 0xFF | (doubt & 0xFF) << 8
    return int(r | (every >> 8) << 24 | (doubt >> 8) << 32)


@compiled
def operate(results: npt.NDArray[np.int16], memo: Ints, op: int, a: int, x: int) -> int:
    """Return the result of cells `a` and `x`, as `joined` does."""
    if (a | x) >> 8 == 0:
        word = results[op, x, a]
        return int(word & 0xFF | word >> 8 << 24)
    key = (op << 17 | a) << 17 | x
    entry = memo[(key * SPREAD >> 40) % MEMO]
    # A collision replaces the entry; the whole key is compared, so it costs time only.
    if entry[0] != key:
        entry[0], entry[1] = key, joined(results[op], a, x)
    return int(entry[1])


@compiled
def ratio(s: Ints) -> int:
    """Return the cycles in which TMR0 counts one."""
    return 1 if s[OPTION] & PSA else 2 << (s[OPTION] & PS)


@compiled
def timer(s: Ints, cycle: int) -> int:
    """Return what an instruction in `cycle` reads from TMR0."""
    if s[T0] & UNKNOWN:
        return UNKNOWN
    return int((max(cycle, s[T0_FROM]) - s[T0_ZERO]) // ratio(s) & 0xFF | s[T0] & 1 << 16)


@compiled
def plan_time_out(s: Ints, board: ChipSurroundings, changed: int, cycle: int) -> None:
    """Set the first cycle in which any chip's watchdog may time out: after CLRWDT, or after PSA or PS have
    `changed`, of which the prescaler may have kept any count.
    """
    if board.watchdog:
        scaled = s[OPTION] & PSA and not changed  # its prescaler's count is 0 since CLRWDT
        s[WDT_DUE] = s[CLEARED] + (board.watchdog << (s[OPTION] & PS) if scaled else board.watchdog)
        if changed and cycle - s[CLEARED] >= board.watchdog:
            s[WDT_DUE] = cycle


@compiled
def request(s: Ints, cycle: int) -> None:
    """Note whether an interrupt is requested from `cycle` on."""
    if s[INTCON] & (GIE | T0IE | T0IF) == GIE | T0IE | T0IF:
        s[IRQ] = min(s[IRQ], cycle)
    elif s[IRQ] >= cycle:
        s[IRQ] = NEVER


@compiled
def drive(s: Ints, edge_at: Ints, edge_out: Ints, board: ChipSurroundings, cycle: int) -> int:
    """Compare the pins with the expected edges after the instruction of `cycle` wrote a port or TRIS."""
    tris = s[TRISA] | s[TRISB] << 5
    out = (s[PORTA] & 0x1F | (s[PORTB] & 0xFF) << 5) & ~tris
    dark = (s[PORTA] >> 8 | s[PORTB] >> 8 << 5) & ~tris
    s[DARK] = min(s[DARK], cycle + GLITCH) if dark else NEVER
    if s[FRAME] == BEFORE and out == 0:
        return GOES_ON
    if dark or tris & board.channels:
        return DARK_PIN
    if s[FRAME] == BEFORE:
        # The first rise is the schedule's first edge: it fixes the beginning of the frame.
        s[FRAME] = cycle - edge_at[0]
    edge = s[EDGE]
    if out != (edge_out[edge - 1] if edge else 0):
        if edge == len(edge_at) or cycle != s[FRAME] + edge_at[edge] or out != edge_out[edge]:
            return WRONG_EDGE
        s[EDGE] += 1
    return GOES_ON


@compiled
def read(s: Ints, board: ChipSurroundings, slot: int, cycle: int) -> int:
    """Return the byte that an instruction in `cycle` reads from a register."""
    if slot in (PORTA, PORTB):
        driven, used, shift = ~s[slot + BANK_1], 0xFF, 5
        if slot == PORTA:
            used, shift = 0x1F, 0
            if s[PORTA] & ~board.channels & 0x10:
                driven &= ~0x10  # RA4 is an open drain: something outside may pull it low
        held = ~driven & board.held >> shift
        unknown = (s[slot] >> 8 & driven | ~driven & ~held) & used
        return int((s[slot] & driven | board.levels >> shift & held) & used & ~unknown | unknown << 8)
    if slot == INTCON:  # INTF and RBIF may be set by any level of the pins
        unknown = s[INTCON] >> 8 | 3 | (T0IF if s[T0] >> 8 else 0)
        return int(s[INTCON] & 0xFF & ~unknown | unknown << 8)
    if slot == T0:
        return timer(s, cycle)
    return int(s[PC] + 1 & 0xFF if slot == PCL else s[slot])


@compiled
def write(s: Ints, eeprom: Ints, board: ChipSurroundings, slot: int, cycle: int, r: int) -> int:
    """Write a register other than PCL, STATUS and the ports by an instruction in `cycle`."""
    m = 0xFF if r >> 16 else r >> 8
    if slot == T0:
        if s[T0] >> 8:  # it may have overflowed
            s[INTCON] = s[INTCON] & ~T0IF | T0IF << 8
        s[T0] = UNKNOWN if (m and not r >> 16) or s[OPTION] & T0CS else r & 1 << 16
        s[T0_FROM], s[T0_ZERO] = cycle + 3, cycle + 3 - (r & 0xFF) * ratio(s)
        s[T0_DUE] = NEVER if s[T0] else s[T0_ZERO] + 256 * ratio(s) - 1
    elif slot == INTCON:
        if m & ~7:
            return REGISTER
        s[INTCON] = r & 0xFF | (m & T0IF) << 8
        request(s, cycle + 1)
    elif slot == OPTION:
        if m:
            return REGISTER
        changed = s[OPTION] ^ r
        s[OPTION] = r
        if changed & (T0CS | PSA | PS):  # when TMR0 begins to count by the new clock is not specified
            s[T0], s[T0_FROM], s[T0_ZERO], s[T0_DUE] = UNKNOWN, 0, 0, NEVER
            if changed & (PSA | PS):
                plan_time_out(s, board, changed, cycle)
    elif slot == EECON1:
        if m & ~8 or r & 0x12:
            return EEPROM_WRITE
        s[EECON1] = r & 0x80C
        if r & 1:
            s[EEDATA] = eeprom[s[EEADR]] if s[EEADR] < 64 else UNKNOWN
    elif slot == PCLATH:
        s[PCLATH] = r & ~m & 0x1F | (m & 0x1F) << 8
    elif slot != NOWHERE:
        s[slot] = r
    return GOES_ON


@compiled
def ask(s: Ints, slot: int, bits: int) -> int:
    """Stop before an instruction that depends on unknown `bits` of a slot, the lowest one first."""
    s[ASKED], s[ASKED_BIT] = slot, bits & -bits & 0xFF
    return FORK if bits & 0xFF else PHASE


@compiled
def attend(s: Ints, edge_at: Ints, board: ChipSurroundings) -> int:
    """Process the events due between two instructions; return the reason to stop."""
    now = s[CYCLE]
    if now >= s[T0_DUE]:  # one cycle before TMR0 is read as 00h
        s[INTCON] = s[INTCON] & ~(T0IF << 8) | T0IF
        request(s, s[T0_DUE])
        s[T0_DUE] += 256 * ratio(s)
    enabled = s[INTCON] & (INTE | RBIE | T0IE) if s[INTCON] & GIE else 0
    if enabled & ~T0IE or (enabled and (s[INTCON] >> 8 & T0IF or s[T0] >> 8)):
        return INTERRUPT
    if now >= s[WDT_DUE]:
        return WATCHED
    if now > s[DARK]:
        return DARK_PIN
    pending = NEVER
    if s[FRAME] != BEFORE:
        pending = s[FRAME] + (edge_at[s[EDGE]] + 1 if s[EDGE] < len(edge_at) else board.period)
        if now >= pending:
            return MISSING if s[EDGE] < len(edge_at) else NEW_FRAME
    if s[IRQ] < now:
        if s[DEPTH] == 8:
            return OVERFLOW
        s[STACK + s[DEPTH]] = s[PC]
        s[DEPTH] += 1
        s[PC] = 4
        s[INTCON] &= ~GIE
        s[CYCLE] = s[IRQ] + 3
        s[IRQ] = NEVER
        return INTERRUPTED
    s[NEXT_EVENT] = min(s[T0_DUE], s[WDT_DUE], s[DARK] + 1, pending, s[IRQ] + 1, board.limit)
    return TOO_LONG if now >= board.limit else GOES_ON


@compiled
def run(
    s: Ints, used: Ints, edge_at: Ints, edge_out: Ints, memory: ChipMemory, board: ChipSurroundings
) -> int:
    """Run to the next cut, fork, frame or last edge of a frame, and return the reason; the instruction at PC
    is not executed.

    Note in `used` which of W and the RAM were read before they were written, and which were written. The run
    depends on no others of these bytes, and changes none but the written ones.
    """
    code, eeprom, results, slots, memo = memory
    s[NEXT_EVENT] = 0
    pulses = s[EDGE] < len(edge_at)
    while True:
        why = GOES_ON
        if s[CYCLE] >= s[NEXT_EVENT]:
            why = attend(s, edge_at, board)
            if why == INTERRUPTED:
                continue
            if why == GOES_ON and pulses and s[EDGE] == len(edge_at):
                return LAST_EDGE
            if why != GOES_ON:
                return why
        pc, cycle, w, status = s[PC], s[CYCLE], s[W], s[STATUS]
        flow = code[pc, FLOW]
        if flow in (NO_FLOW, SLEEP):
            return SLEEPS if flow == SLEEP else NO_WORD
        # A listed state has no time of a timer that stands still, and no pending interrupt: such a visit is
        # passed by.
        if code[pc, IS_CUT] and cycle > 0 and cycle >= s[T0_FROM] and s[IRQ] == NEVER and s[FRAME] != BEFORE:
            return CUT
        # 1: the operands
        slot, f, a, x = code[pc, SLOT], code[pc, ADDRESS], code[pc, K] & 0xFF, code[pc, X]
        # What decides where an operand is, or where execution goes on, has to be known: the checker tries
        # both values.
        if f == 0 and s[FSR] >> 8:
            return ask(s, FSR, s[FSR] >> 8)
        if f > 0 and status >> 8 & RP0 and slots[f] != slots[f | 0x80]:
            return ask(s, STATUS, RP0)
        if f >= 0:
            slot = slots[f | (status & RP0) << 2 if f else s[FSR]]
        if code[pc, READS_F]:
            a = s[slot]
            if used[slot] == 0:
                used[slot] = READ
            if slot < RAM:
                a = read(s, board, slot, cycle)
                given = a >> 8 & ~s[GIVEN] >> 8 & 0xFF
                a = a & ~(given << 8) | s[GIVEN] & given
        source = GIVEN if slot in (PORTA, PORTB, INTCON, T0) else slot
        if x == X_IS_W:
            x = w
            if used[W] == 0:
                used[W] = READ
        elif x == X_IS_CARRY:
            x = status & 0x101
        if a >> 8 and slot in (PORTA, PORTB) and not code[pc, TO_F]:
            asked = a >> 8 & board.buttons >> (5 if slot == PORTB else 0)
            asked &= x if flow == SKIP else 0xFF
            if asked:
                ask(s, slot, asked)
                return BUTTON
        # 2: the operation
        result = operate(results, memo, code[pc, OP], a, x)
        r = result & 0x1FFFF
        m = r >> 8
        after, cycles = pc + 1, 1 if flow in (NEXT, SKIP, CLRWDT) else 2
        if flow == SKIP:
            if m and (m >> 8 or r & 0xFF == 0):
                return ask(s, source, m & a >> 8)
            if r == 0:
                after, cycles = pc + 2, 2
        if code[pc, TO_F] and slot == PCL:
            if m:
                return ask(s, W, w >> 8) if w >> 8 else ask(s, STATUS, status >> 8 & 1)
            if s[PCLATH] >> 8 & 3:
                return ask(s, PCLATH, s[PCLATH] >> 8 & 3)
            after, cycles = s[PCLATH] << 8 | r, 2
        # 3: its effects
        flags = code[pc, FLAGS] << 8 | code[pc, FLAGS]
        s[STATUS] = status & ~flags | result >> 24 & flags
        if code[pc, TO_W]:
            s[W] = r
            used[W] |= WRITTEN
        elif code[pc, TO_F] and slot >= RAM and slot < RAM_END:
            s[slot] = r
            used[slot] |= WRITTEN
        elif code[pc, TO_F] and slot == STATUS:
            keep = (TO_PD | (7 if flags else 0)) * 0x101
            s[STATUS] = s[STATUS] & keep | (UNKNOWN if m >> 8 else r) & ~keep
        elif code[pc, TO_F] and slot in (PORTA, PORTB, TRISA, TRISB):
            if m and (m >> 8 or slot >= TRISA):
                return REGISTER
            s[slot] = r & 0x1F1F if slot in (PORTA, TRISA) else r
            s[NEXT_EVENT] = 0
            why = drive(s, edge_at, edge_out, board, cycle)
        elif code[pc, TO_F] and slot != PCL:
            s[NEXT_EVENT] = 0
            why = write(s, eeprom, board, slot, cycle, r)
        if why != GOES_ON:
            return why
        # 4: where it goes on
        if flow == JUMP:
            after = code[pc, K]
        elif flow == CALL:
            if s[DEPTH] == 8:
                return OVERFLOW
            s[STACK + s[DEPTH]] = after & 0x3FF
            s[DEPTH] += 1
            after = code[pc, K]
        elif flow == RETURN:
            if s[DEPTH] == 0:
                return EMPTY
            s[DEPTH] -= 1
            after = s[STACK + s[DEPTH]]
            s[STACK + s[DEPTH]] = 0
        elif flow == CLRWDT:
            s[STATUS] = s[STATUS] & ~(TO_PD << 8) | TO_PD
            s[CLEARED], s[NEXT_EVENT] = cycle + 1, 0
            plan_time_out(s, board, 0, cycle)
        s[GIVEN] = UNKNOWN
        s[PC] = after & 0x3FF
        s[CYCLE] = cycle + cycles
