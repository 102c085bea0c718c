"""The PIC16F84 with unknown bits, compiled by numba: runs a program from one state to the next event.

In: a vector of integers (the state), the program, the edges that are due in this frame. Out: the state later,
and the reason why it stopped. A byte is a cell v | m << 8 | p << 16: the bits of m are unknown (and 0 in v);
if p is 1, the byte is v + φ mod 256, with one φ for all such bytes, the unknown phase of TMR0.
Section numbers are those of DS35007; the cycles of interrupts are those of DS30430 figures 6-4 and 8-17.
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


# The state -----------------------------------------------------------------------------------------------

# Slots: a register of bank 0 at its address (ports: the latch), one of bank 1 at 0x50 + its address in it.
NOWHERE, TMR0, PCL, STATUS, FSR, PORTA, PORTB = range(7)
EEDATA, EEADR, PCLATH, INTCON, RAM, RAM_END = 8, 9, 10, 11, 12, 0x50
BANK_1 = W = 0x50
OPTION, TRISA, TRISB, EECON1, EECON2 = 0x51, 0x55, 0x56, 0x58, 0x59
(PC, DEPTH,
 CYCLE,             # of the next instruction
 TMR0_FROM,         # the cycle from which TMR0 counts again after a write
 TMR0_ZERO,         # a cycle in which its count was 0
 OVERFLOW_AT,       # the cycle in which T0IF is set next
 REQUESTED,         # the cycle in which an interrupt was sampled
 DOUBTED,           # the flags that may have been sampled in the latest instruction
 DECLINED,          # the cycle in which none of them was, by choice
 CLEARED,           # the cycle after CLRWDT
 TIME_OUT_AT,       # the cycle from which on a watchdog may time out
 WRITTEN_BY,        # the cycle in which an EEPROM write is over on every chip
 UNFINISHED,        # the cycle in which it was not over, by choice
 KEYS, KEY_AT,      # how many keys were written to EECON2, and when
 DARK_UNTIL,        # the last cycle in which a pin may have an unknown level
 FRAME,             # the cycle in which the frame began
 EDGE,              # the number of the frame's next edge
 NEXT_EVENT,        # the cycle up to which `events` has nothing to do
 CHOSEN,            # a cell: bits that the next instruction reads, by choice
 ASKED, ASKED_BIT,  # what has to be chosen: a slot and a bit
 STACK) = range(0x60, 0x77)  # fmt: skip
SLOTS = STACK + 8
UNKNOWN = 0xFF00
NEVER = 1 << 60
BEFORE = -NEVER
"""`FRAME` before the first pulse."""

C, DC, Z, RP0, TO, TO_PD = 1, 2, 4, 0x20, 0x10, 0x18
GIE, EEIE, T0IE, INTE, RBIE = 0x80, 0x40, 0x20, 0x10, 0x08
T0IF, INTF, RBIF, FLAGS_OF_INTCON, WRITE_OVER = 4, 2, 1, 7, 8
"""Flags: each is three places below its enable bit in INTCON; EEIF, which is in EECON1, counts as 8."""
T0CS, PSA, PS = 0x20, 0x08, 0x07
RD, WR, WREN, WRERR, EEIF = 1, 2, 4, 8, 0x10


class RegisterSlot(NamedTuple):
    """A slot that programs can access."""

    slot: int
    reset: int
    """After any reset: table 6-4, where x and u are unknown."""
    unknown: int = 0
    """The bits that may be unknown."""
    both_banks: bool = False


REGISTERS = (
    RegisterSlot(W, UNKNOWN, 0xFF),
    RegisterSlot(STATUS, 0x1F00, 0xFF, both_banks=True),  # TO and PD differ between resets
    RegisterSlot(FSR, UNKNOWN, 0xFF, both_banks=True),
    RegisterSlot(PORTA, 0x1F00, 0x1F),
    RegisterSlot(PORTB, UNKNOWN, 0xFF),
    RegisterSlot(EEDATA, UNKNOWN, 0xFF),
    RegisterSlot(EEADR, UNKNOWN, 0xFF),
    RegisterSlot(PCLATH, 0, 0x1F, both_banks=True),
    RegisterSlot(INTCON, 0x0300, 0x07, both_banks=True),  # the pins may set INTF and RBIF at once
    RegisterSlot(EECON1, 0x0800, 0x08),
    RegisterSlot(TMR0, UNKNOWN, 0xFF),
    RegisterSlot(OPTION, 0xFF),
    RegisterSlot(TRISA, 0x1F),
    RegisterSlot(TRISB, 0xFF),
)
"""Those with unknown bits first, of these TMR0 last."""
READ, CHANGED = 1, 2
"""What `run` notes of W and each byte of RAM: that it was read before it was written; that it was written."""

REASONS = (
    "cut", "frame", "fork", "button", "the frame's last edge", "an interrupt that may come",
    "an EEPROM write that may be over", "SLEEP", "the cycle limit", "an edge that is not expected",
    "a missing edge", "a word that is not an instruction", "a stack of more than eight levels",
    "a return with an empty stack", "a watchdog that may time out",
    "a pin whose level is unknown or not driven", "an unknown value in a register",
    "control that depends on TMR0's phase", "an EEPROM write without its sequence",
)  # fmt: skip
(CUT, NEW_FRAME, FORK, BUTTON, LAST_EDGE, MAY_INTERRUPT, MAY_BE_WRITTEN, SLEEPS, TOO_LONG, WRONG_EDGE,
 MISSING, NO_WORD, OVERFLOW, EMPTY, WATCHED, DARK_PIN, REGISTER, PHASE, SEQUENCE) = range(19)  # fmt: skip
GOES_ON, INTERRUPTED = -1, -2

# The program ---------------------------------------------------------------------------------------------

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
    """The cells of the EEPROM; then whether one was read, and whether a write began."""
    results: npt.NDArray[np.int16]
    """By operation, `x` and `a`: the result, and the flags from bit 8 on."""
    slots: Ints
    """Of each address, with the bank in bit 7."""
    memo: Ints
    """Results of unknown operands."""


EEPROM_READ, EEPROM_WRITTEN = 64, 65


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
    longest_write: int = 0
    """The longest EEPROM write in cycles."""


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
    for slot in (*(row.slot for row in REGISTERS if row.slot != W), EECON2):
        slots[slot if slot < BANK_1 else slot - BANK_1 | 0x80] = slot
    both = [row.slot for row in REGISTERS if row.both_banks]
    for low in (PCL, *both, *range(RAM, RAM_END)):
        slots[[low, low | 0x80]] = low
    return slots


# Instructions on unknown bits ----------------------------------------------------------------------------


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


# What happens by itself ----------------------------------------------------------------------------------


@compiled
def ratio(s: Ints) -> int:
    """Return the cycles in which TMR0 counts one (section 5.2)."""
    return 1 if s[OPTION] & PSA else 2 << (s[OPTION] & PS)


@compiled
def timer(s: Ints, cycle: int) -> int:
    """Return what an instruction in `cycle` reads from TMR0."""
    if s[TMR0] & UNKNOWN:
        return UNKNOWN
    return int((max(cycle, s[TMR0_FROM]) - s[TMR0_ZERO]) // ratio(s) & 0xFF | s[TMR0] & 1 << 16)


@compiled
def plan_time_out(s: Ints, board: ChipSurroundings, changed: int, cycle: int) -> None:
    """Set the first cycle in which any chip's watchdog may time out: after CLRWDT, or after PSA or PS have
    `changed`, of which the prescaler may have kept any count (section 6.10).
    """
    if board.watchdog:
        scaled = s[OPTION] & PSA and not changed  # its prescaler's count is 0 since CLRWDT
        s[TIME_OUT_AT] = s[CLEARED] + (board.watchdog << (s[OPTION] & PS) if scaled else board.watchdog)
        if changed and cycle - s[CLEARED] >= board.watchdog:
            s[TIME_OUT_AT] = cycle


@compiled
def clear_watchdog(s: Ints, board: ChipSurroundings, cycle: int, to_pd: int) -> None:
    """Clear the watchdog, before `cycle`, and set TO and PD (section 6.10, table 6-3)."""
    s[STATUS] = s[STATUS] & ~(TO_PD << 8 | TO_PD) | to_pd
    s[CLEARED], s[NEXT_EVENT] = cycle, 0
    plan_time_out(s, board, 0, cycle)


@compiled
def enabled(s: Ints) -> int:
    """Return the enabled flags; GIE is another matter (section 6.8)."""
    return int(s[INTCON] >> 3 & (FLAGS_OF_INTCON | WRITE_OVER))


@compiled
def certain(s: Ints) -> int:
    """Return the enabled flags that are set; they end SLEEP, and interrupt if GIE is set."""
    over = WRITE_OVER if s[EECON1] & EEIF else 0
    return int(enabled(s) & (s[INTCON] & FLAGS_OF_INTCON | over))


@compiled
def doubtful(s: Ints) -> int:
    """Return the enabled flags that may be set in any cycle, by a pin, TMR0 or the end of a write."""
    flags = s[INTCON] >> 8 | (WRITE_OVER if s[EECON1] & WR else 0)
    return int(enabled(s) & (flags | (T0IF if s[TMR0] >> 8 else 0)) & ~certain(s))


@compiled
def request(s: Ints, cycle: int) -> None:
    """Note whether an interrupt is sampled from `cycle` on; one that was sampled before comes."""
    if s[INTCON] & GIE and certain(s):
        s[REQUESTED] = min(s[REQUESTED], cycle)
    elif s[REQUESTED] >= cycle:
        s[REQUESTED] = NEVER


@compiled
def interrupt(s: Ints, cycle: int) -> int:
    """Go to the interrupt vector, whose instruction is executed in `cycle` (section 6.8)."""
    if s[DEPTH] == 8:
        return OVERFLOW
    s[STACK + s[DEPTH]] = s[PC]
    s[DEPTH] += 1
    s[INTCON] &= ~GIE
    s[PC], s[CYCLE], s[REQUESTED], s[DOUBTED], s[NEXT_EVENT] = 4, cycle, NEVER, 0, 0
    return INTERRUPTED


@compiled
def happen(s: Ints, flag: int) -> None:
    """Let a flag that is doubtful be set now."""
    if flag == WRITE_OVER:  # section 3.2
        s[EECON1] = s[EECON1] & ~WR | EEIF
        s[WRITTEN_BY], s[UNFINISHED] = NEVER, -1
    else:
        s[INTCON] = s[INTCON] & ~(flag << 8) | flag


@compiled
def events(s: Ints, edge_at: Ints, board: ChipSurroundings) -> int:
    """Process the events that are due between two instructions; return the reason to stop."""
    now = s[CYCLE]
    if now >= s[OVERFLOW_AT]:  # one cycle before TMR0 is read as 00h (section 5.3)
        s[INTCON] = s[INTCON] & ~(T0IF << 8) | T0IF
        request(s, s[OVERFLOW_AT])
        s[OVERFLOW_AT] += 256 * ratio(s)
    if now >= s[WRITTEN_BY]:
        by = s[WRITTEN_BY]
        happen(s, WRITE_OVER)
        request(s, by)
    if now >= s[TIME_OUT_AT]:
        return WATCHED
    if now > s[DARK_UNTIL]:
        return DARK_PIN
    pending = NEVER
    if s[FRAME] != BEFORE:
        pending = s[FRAME] + (edge_at[s[EDGE]] + 1 if s[EDGE] < len(edge_at) else board.period)
        if now >= pending:
            return MISSING if s[EDGE] < len(edge_at) else NEW_FRAME
    if s[DOUBTED] and s[DECLINED] != now:
        return MAY_INTERRUPT
    if s[REQUESTED] < now:
        return int(interrupt(s, s[REQUESTED] + 3))
    # What the next instruction samples may interrupt after it, even if it clears GIE.
    s[DOUBTED] = doubtful(s) if s[INTCON] & GIE else 0
    s[DECLINED] = now if s[DOUBTED] else -1
    s[NEXT_EVENT] = min(s[OVERFLOW_AT], s[TIME_OUT_AT], s[DARK_UNTIL] + 1, pending, s[REQUESTED] + 1,
                        s[WRITTEN_BY], now if s[DOUBTED] else board.limit, board.limit)  # fmt: skip
    return TOO_LONG if now >= board.limit else GOES_ON


@compiled
def wake(s: Ints, board: ChipSurroundings, flag: int) -> None:
    """Go on after SLEEP, which a flag has ended, or (0) the watchdog; TMR0 stood still, and the watchdog is
    cleared (section 6.11.2).
    """
    if flag:
        happen(s, flag)
    s[PC], s[CYCLE], s[DOUBTED], s[CHOSEN] = s[PC] + 1 & 0x3FF, s[CYCLE] + 1, 0, UNKNOWN
    if s[EECON1] & WR:  # it went on, at least while the oscillator started (1024 periods, section 6.6)
        s[WRITTEN_BY] = max(s[WRITTEN_BY] - 256, s[CYCLE])
    clear_watchdog(s, board, s[CYCLE], TO if flag else 0)
    request(s, s[CYCLE])  # the instruction after SLEEP is executed before the interrupt


@compiled
def do_not_sleep(s: Ints, flag: int) -> None:
    """Go on after a SLEEP that is a NOP, because an enabled flag is set (section 6.11.3)."""
    happen(s, flag)
    request(s, s[CYCLE])
    s[PC], s[CYCLE], s[CHOSEN], s[NEXT_EVENT] = s[PC] + 1 & 0x3FF, s[CYCLE] + 1, UNKNOWN, 0


# Registers -----------------------------------------------------------------------------------------------


@compiled
def drive(s: Ints, edge_at: Ints, edge_out: Ints, board: ChipSurroundings, cycle: int) -> int:
    """Compare the pins with the expected edges after the instruction of `cycle` wrote a port or TRIS."""
    tris = s[TRISA] | s[TRISB] << 5
    out = (s[PORTA] & 0x1F | (s[PORTB] & 0xFF) << 5) & ~tris
    dark = (s[PORTA] >> 8 | s[PORTB] >> 8 << 5) & ~tris
    s[DARK_UNTIL] = min(s[DARK_UNTIL], cycle + GLITCH) if dark else NEVER
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
                driven &= ~0x10  # RA4 is an open drain: something outside may pull it low (section 4.1)
        held = ~driven & board.held >> shift
        unknown = (s[slot] >> 8 & driven | ~driven & ~held) & used
        return int((s[slot] & driven | board.levels >> shift & held) & used & ~unknown | unknown << 8)
    if slot == INTCON and s[TMR0] >> 8 and not s[INTCON] & T0IF:  # it may have overflowed
        return int(s[INTCON] & ~T0IF | T0IF << 8)
    if slot == TMR0:
        return timer(s, cycle)
    return int(s[PC] + 1 & 0xFF if slot == PCL else s[slot])


@compiled
def write_timer(s: Ints, cycle: int, r: int) -> None:
    """Write TMR0, which then stands still for two cycles (section 5)."""
    m = 0xFF if r >> 16 else r >> 8
    if s[TMR0] >> 8 and not s[INTCON] & T0IF:  # it may have overflowed
        s[INTCON] = s[INTCON] & ~T0IF | T0IF << 8
    s[TMR0] = UNKNOWN if (m and not r >> 16) or s[OPTION] & T0CS else r & 1 << 16
    s[TMR0_FROM], s[TMR0_ZERO] = cycle + 3, cycle + 3 - (r & 0xFF) * ratio(s)
    s[OVERFLOW_AT] = NEVER if s[TMR0] else s[TMR0_ZERO] + 256 * ratio(s) - 1


@compiled
def write_option(s: Ints, board: ChipSurroundings, cycle: int, r: int) -> None:
    """Write OPTION_REG. When TMR0 begins to count by another clock is not specified (section 5)."""
    changed = s[OPTION] ^ r
    s[OPTION] = r
    if changed & (T0CS | PSA | PS):
        s[TMR0], s[TMR0_FROM], s[TMR0_ZERO], s[OVERFLOW_AT] = UNKNOWN, 0, 0, NEVER
    if changed & (PSA | PS):
        plan_time_out(s, board, changed, cycle)


@compiled
def write_eecon1(s: Ints, eeprom: Ints, board: ChipSurroundings, cycle: int, r: int) -> int:
    """Write EECON1: RD reads at once; WR begins a write if the keys 55h and AAh were written to EECON2 three
    and one cycles ago, and can be set, but not cleared (section 3).
    """
    began = s[EECON1] & WR == 0 and r & WR
    if began and not (s[KEYS] == 2 and s[KEY_AT] + 1 == cycle and s[EECON1] & WREN):
        return SEQUENCE
    s[EECON1] = r & (EEIF | WREN | WRERR | WRERR << 8) | (s[EECON1] | r) & WR
    if began:
        s[WRITTEN_BY], eeprom[EEPROM_WRITTEN] = cycle + 1 + board.longest_write, 1
        s[KEYS] = s[KEY_AT] = 0
    if r & RD:
        s[EEDATA] = eeprom[s[EEADR]] if s[EEADR] < 64 else UNKNOWN
        eeprom[EEPROM_READ] = 1
    request(s, cycle + 1)
    return GOES_ON


@compiled
def write(s: Ints, eeprom: Ints, board: ChipSurroundings, slot: int, cycle: int, r: int) -> int:
    """Write a register other than PCL, STATUS and the ports by an instruction in `cycle`."""
    m = 0xFF if r >> 16 else r >> 8
    if (slot == INTCON and m & ~FLAGS_OF_INTCON) or (slot == OPTION and m) or (slot == EECON1 and m & ~WRERR):
        return REGISTER
    if slot == TMR0:
        write_timer(s, cycle, r)
    elif slot == INTCON:  # INTF and RBIF may be set again at once by the pins (section 6.8)
        s[INTCON] = r & 0xFF | (m | (INTF | RBIF) & ~r) << 8
        request(s, cycle + 1)
    elif slot == OPTION:
        write_option(s, board, cycle, r)
    elif slot == EECON1:
        return int(write_eecon1(s, eeprom, board, cycle, r))
    elif slot == EECON2:  # the keys, MOVLW between them (section 3.2)
        second = r == 0xAA and s[KEYS] == 1 and s[KEY_AT] + 2 == cycle
        s[KEYS], s[KEY_AT] = 2 if second else 1 if r == 0x55 else 0, cycle
    elif slot == PCLATH:
        s[PCLATH] = r & ~m & 0x1F | (m & 0x1F) << 8
    elif slot != NOWHERE:
        s[slot] = r
    return GOES_ON


# Instructions --------------------------------------------------------------------------------------------


@compiled
def ask(s: Ints, slot: int, bits: int) -> int:
    """Stop before an instruction that depends on unknown `bits` of a slot, the lowest one first."""
    s[ASKED], s[ASKED_BIT] = slot, bits & -bits & 0xFF
    return FORK if bits & 0xFF else PHASE


@compiled
def locate(s: Ints, f: int, slots: Ints) -> int:
    """Return the slot of the register at `f` in an instruction, or -1 to stop if it depends on unknown bits:
    those of FSR or RP0 (section 2).
    """
    doubt = s[STATUS] >> 8 & RP0 if f > 0 and slots[f] != slots[f | 0x80] else 0
    if f == 0 and s[FSR] >> 8:
        ask(s, FSR, s[FSR] >> 8)
        return -1
    if doubt:
        ask(s, STATUS, RP0)
        return -1
    return int(slots[f | (s[STATUS] & RP0) << 2 if f else s[FSR]])


@compiled
def register(s: Ints, board: ChipSurroundings, slot: int) -> int:
    """Return a register as the next instruction reads it, with the bits that were chosen."""
    a = read(s, board, slot, s[CYCLE])
    chosen = a >> 8 & ~s[CHOSEN] >> 8 & 0xFF
    return int(a & ~(chosen << 8) | s[CHOSEN] & chosen)


@compiled
def undecided(
    s: Ints, code: Ints, pc: int, board: ChipSurroundings, slot: int, a: int, x: int, r: int
) -> int:
    """Return the reason to stop before an instruction if unknown bits decide where it leads, or it reads
    buttons; `r` is the cell of its result.
    """
    m = r >> 8
    if a >> 8 and slot in (PORTA, PORTB) and not code[pc, TO_F]:
        asked = (
            a >> 8 & board.buttons >> (5 if slot == PORTB else 0) & (x if code[pc, FLOW] == SKIP else 0xFF)
        )
        if asked:
            ask(s, slot, asked)
            return BUTTON
    if code[pc, FLOW] == SKIP and m and (m >> 8 or r & 0xFF == 0):
        bits = m & a >> 8
        # What pins and an unknown timer say is chosen for one instruction, a bit of a register for good.
        passes = slot in (PORTA, PORTB, TMR0) or (slot == INTCON and (s[TMR0] >> 8 or bits & (INTF | RBIF)))
        return int(ask(s, CHOSEN if passes else slot, bits))
    if code[pc, TO_F] and slot == PCL:
        if m:
            return int(ask(s, W, s[W] >> 8) if s[W] >> 8 else ask(s, STATUS, s[STATUS] >> 8 & 1))
        if s[PCLATH] >> 8 & 3:
            return int(ask(s, PCLATH, s[PCLATH] >> 8 & 3))
    return GOES_ON


@compiled
def store(
    s: Ints, edge_at: Ints, edge_out: Ints, eeprom: Ints, board: ChipSurroundings,
    slot: int, r: int, flags: int,
) -> int:  # fmt: skip
    """Write the result of an instruction that affects `flags` to a register."""
    if slot == STATUS:  # TO and PD cannot be written, nor can the flags that it affects (section 2.3.1)
        keep = (TO_PD | (7 if flags else 0)) * 0x101
        s[STATUS] = s[STATUS] & keep | (UNKNOWN if r >> 16 else r) & ~keep
        return GOES_ON
    if slot == PCL:
        return GOES_ON
    s[NEXT_EVENT] = 0
    if slot not in (PORTA, PORTB, TRISA, TRISB):
        return int(write(s, eeprom, board, slot, s[CYCLE], r))
    if r >> 8 and (r >> 16 or slot >= TRISA):
        return REGISTER
    s[slot] = r & 0x1F1F if slot in (PORTA, TRISA) else r
    return int(drive(s, edge_at, edge_out, board, s[CYCLE]))


@compiled
def call(s: Ints, address: int) -> int:
    """Push the address of the next instruction, and go to another (section 2.4)."""
    if s[DEPTH] == 8:
        return OVERFLOW
    s[STACK + s[DEPTH]] = s[PC] + 1 & 0x3FF
    s[DEPTH] += 1
    s[PC] = address
    return GOES_ON


@compiled
def leave(s: Ints, retfie: bool) -> int:
    """Return from a subroutine, or from the interrupt, in whose second cycle a flag may be sampled."""
    if s[DEPTH] == 0:
        return EMPTY
    s[DEPTH] -= 1
    s[PC] = s[STACK + s[DEPTH]]
    s[STACK + s[DEPTH]] = 0
    if retfie:
        s[DOUBTED] = doubtful(s)
    return GOES_ON


@compiled
def at_rest(s: Ints) -> bool:
    """Return whether a listed state can describe this one: it has no time of a timer that stands still, no
    interrupt under way, and no keys in EECON2.
    """
    keys = s[KEYS] > 0 and s[CYCLE] <= s[KEY_AT] + 2
    return not keys and s[CYCLE] >= s[TMR0_FROM] and s[REQUESTED] == NEVER


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
    reason = GOES_ON
    while reason == GOES_ON:
        if s[CYCLE] >= s[NEXT_EVENT]:
            reason = events(s, edge_at, board)
            if reason == INTERRUPTED:
                reason = GOES_ON
                continue
            if reason == GOES_ON and pulses and s[EDGE] == len(edge_at):
                return LAST_EDGE
            if reason != GOES_ON:
                return int(reason)
        pc, cycle = s[PC], s[CYCLE]
        if code[pc, IS_CUT] and cycle > 0 and s[FRAME] != BEFORE and at_rest(s) and not s[DOUBTED]:
            return CUT
        flow = code[pc, FLOW]
        if flow in (NO_FLOW, SLEEP):
            return SLEEPS if flow == SLEEP else NO_WORD
        # 1: the operands: a register or literal, and W, the carry or the instruction's bit
        slot, a, x = code[pc, SLOT], code[pc, K] & 0xFF, code[pc, X]
        if code[pc, ADDRESS] >= 0:
            slot = locate(s, code[pc, ADDRESS], slots)
            if slot < 0:
                return FORK if s[ASKED_BIT] else PHASE
        if slot == EECON1 and s[EECON1] & WR and s[UNFINISHED] != cycle:
            return MAY_BE_WRITTEN
        if code[pc, READS_F]:
            a = register(s, board, slot) if slot < RAM else s[slot]
            if used[slot] == 0:
                used[slot] = READ
        if x == X_IS_W:
            x = s[W]
            if used[W] == 0:
                used[W] = READ
        elif x == X_IS_CARRY:
            x = s[STATUS] & 0x101
        # 2: the result
        result = operate(results, memo, code[pc, OP], a, x)
        r = result & 0x1FFFF
        if (a | r) >> 8 or slot == PCL:
            reason = undecided(s, code, pc, board, slot, a, x, r)
            if reason != GOES_ON:
                return int(reason)
        # 3: its effects
        flags = code[pc, FLAGS] << 8 | code[pc, FLAGS]
        s[STATUS] = s[STATUS] & ~flags | result >> 24 & flags
        if code[pc, TO_W]:
            s[W] = r
            used[W] |= CHANGED
        elif code[pc, TO_F] and RAM <= slot < RAM_END:
            s[slot] = r
            used[slot] |= CHANGED
        elif code[pc, TO_F]:
            reason = store(s, edge_at, edge_out, eeprom, board, slot, r, flags)
        # 4: where it goes on
        after, cycles = pc + 1 & 0x3FF, 1 if flow in (NEXT, SKIP, CLRWDT) else 2
        if flow == SKIP and r == 0:
            after, cycles = pc + 2 & 0x3FF, 2
        elif code[pc, TO_F] and slot == PCL:
            after, cycles = (s[PCLATH] << 8 | r) & 0x3FF, 2
        elif flow == JUMP:
            after = code[pc, K] & 0x3FF
        elif flow in (CALL, RETURN) and reason == GOES_ON:
            reason = call(s, code[pc, K] & 0x3FF) if flow == CALL else leave(s, slot == INTCON)
            after = s[PC]
        elif flow == CLRWDT:
            clear_watchdog(s, board, cycle + 1, TO_PD)
        if reason == GOES_ON:
            s[CHOSEN], s[PC], s[CYCLE] = UNKNOWN, after, cycle + cycles
    return int(reason)
