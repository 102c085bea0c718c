"""The layout of the checker's chip: the slots of its state, the flags and registers, and why a run stops.

The chip itself is in C, `chip.c`; its constants and the struct of the surroundings are made from this module:
each number in capitals has the same name there. Section numbers are those of DS35007.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from servogen.native import Native, constants, struct

# The state -----------------------------------------------------------------------------------------------

# Slots: a register of bank 0 at its address (ports: the latch), one of bank 1 at 0x50 + its address in it.
NOWHERE, TMR0, PCL, STATUS, FSR, PORTA, PORTB = range(7)
EEDATA, EEADR, PCLATH, INTCON, RAM, RAM_END = 8, 9, 10, 11, 12, 0x50
BANK_1 = W = 0x50
OPTION, TRISA, TRISB, EECON1, EECON2 = 0x51, 0x55, 0x56, 0x58, 0x59
(PC, DEPTH,
 CYCLE,             # since the run began
 PRESCALER,         # the cycles since TMR0 counted; 0 if its count is unknown
 STILL,             # the cycles for which TMR0 does not count, after a write
 SAMPLED,           # the cycle after an interrupt was sampled: 1, 2, ...; 0 for none
 DOUBTED,           # the flags that may have been sampled in the latest instruction; from bit 16 on, those of
                    # them that it cleared
 AGE,               # the cycles since the watchdog was cleared
 RESCALED,          # whether its prescaler may have kept a count since then
 WRITE_LEFT,        # the cycles in which an EEPROM write is over on every chip
 KEY_1, KEY_2,      # after a key was written to EECON2: cycles up to the next step of the sequence
 DARK,              # the cycle since a pin has an unknown level: 1, 2, ...; 0 for none
 RESETS,            # before the first read of a wire: the cycle since which the other chip's MCLR is low;
                    # -1: it was, for long enough
 STAGE, TIME, EDGE, # the frames; the cycle in the frame, and the number of its next edge
 CHOSEN,            # a cell: bits that the next instruction reads, by choice
 WAY,               # what happens by itself next, by choice: one of the `ASKED_BITS`
 ASKED, ASKED_BITS, # what has to be chosen: a bit of a slot, or one of several ways
 STACK) = range(0x60, 0x76)  # fmt: skip
(TAKES,             # what the EEPROM of a tape takes next, or gives; 0 without one
 SCL_AGE, SDA_AGE,  # the cycles since the chip changed the line, `SETTLED` at most
 CLOCKS,            # of the EEPROM's byte
 SHIFT,             # the bits that it has taken, or the byte that it gives
 POINTER,           # the address of its next byte; -1 if it is not known
 PULLS,             # whether it pulls SDA low
 SEEN, LOWS,        # what was read of SDA since SCL rose; in how many clocks on end it was low
 DRIVEN,            # the pins of a contract that were an output since the reset
 SLOTS) = range(STACK + 8, STACK + 19)  # fmt: skip
UNKNOWN = 0xFF00
BEFORE, RUNS, OVER, AWAITS, WATCHES = range(5)
"""`STAGE`: before the first pulse; frames follow one another; no pulse will follow; the wire of another chip
is awaited, without pulses; there are no frames: `EDGE` is the levels of the watched pins, `TIME` when they
changed.
"""
SETTLED, MOST_LOW, RA4 = 16, 9, 0x10
"""More cycles than any time of the EEPROM; the clocks on end in which it may hold SDA, which is RA4: its
acknowledge, and a byte of zeros, after which the chip does not acknowledge.
"""
SCL, SDA, FLOATS = 1, 2, 4
"""The levels that chip and EEPROM give the lines; `FLOATS`: the chip's are not known."""
ANYTHING, START, CONTROL, HIGH_BYTE, LOW_BYTE, ADDRESSED, GIVING = range(1, 8)
"""`TAKES`: its state is not known; else what comes next: a start, a byte of the chip's, or its own byte."""
UNSURE, UNREAD, READ_LOW, READ_HIGH = range(4)
"""`SEEN`: SDA may change, because SCL is low or was too short; it stays as it is, and was read or not."""
IS_NOP, NOTHING, ENDLESS = 4, 0x100, 0x200
"""`WAY`: a flag, which is set now; shifted left by `IS_NOP`, one with which SLEEP is a NOP, or which
interrupts a cycle later; or no flag: nothing happens, but that the watchdog ends SLEEP; SLEEP does not end.
"""

C, DC, Z, RP0, TO, TO_PD = 1, 2, 4, 0x20, 0x10, 0x18
GIE, EEIE, T0IE, INTE, RBIE = 0x80, 0x40, 0x20, 0x10, 0x08
T0IF, INTF, RBIF, FLAGS_OF_INTCON, WRITE_OVER, EVERY_FLAG = 4, 2, 1, 7, 8, 15
"""Flags: each is three places below its enable bit in INTCON; EEIF, which is in EECON1, counts as 8."""
T0CS, PSA, PS = 0x20, 0x08, 0x07
RD, WR, WREN, WRERR, EEIF = 1, 2, 4, 8, 0x10


class RegisterSlot(NamedTuple):
    """A slot that programs can access."""

    name: str
    """As certificates call it."""
    slot: int
    reset: int
    """After any reset: table 6-4, where x and u are unknown."""
    unknown: int = 0
    """The bits that may be unknown."""
    both_banks: bool = False
    may_move: bool = False
    """Whether it may be a byte that moves with TMR0's phase."""


REGISTERS = (
    RegisterSlot("w", W, UNKNOWN, 0xFF, may_move=True),
    RegisterSlot("status", STATUS, 0x1F00, 0xFF, both_banks=True),  # TO and PD differ between resets
    RegisterSlot("fsr", FSR, UNKNOWN, 0xFF, both_banks=True, may_move=True),
    RegisterSlot("porta", PORTA, 0x1F00, 0x1F),
    RegisterSlot("portb", PORTB, UNKNOWN, 0xFF),
    RegisterSlot("eedata", EEDATA, UNKNOWN, 0xFF, may_move=True),
    RegisterSlot("eeadr", EEADR, UNKNOWN, 0xFF, may_move=True),
    RegisterSlot("pclath", PCLATH, 0, 0x1F, both_banks=True),
    RegisterSlot("intcon", INTCON, 0x0300, 0x07, both_banks=True),  # the pins may set INTF and RBIF at once
    RegisterSlot("eecon1", EECON1, 0x0800, 0x08),
    RegisterSlot("tmr0", TMR0, UNKNOWN, 0xFF, may_move=True),
    RegisterSlot("option", OPTION, 0xFF),
    RegisterSlot("trisa", TRISA, 0x1F),
    RegisterSlot("trisb", TRISB, 0xFF),
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
    "another chip that is reset at the wrong time, or for too short a time", "a change of the watched pins",
)  # fmt: skip
(CUT, NEW_FRAME, FORK, BUTTON, LAST_EDGE, MAY_INTERRUPT, MAY_BE_WRITTEN, SLEEPS, TOO_LONG, WRONG_EDGE,
 MISSING, NO_WORD, OVERFLOW, EMPTY, WATCHED, DARK_PIN, REGISTER, PHASE, SEQUENCE,
 PULLED, PIN_CHANGE) = range(21)  # fmt: skip
GOES_ON, INTERRUPTED = -1, -2

# The program ---------------------------------------------------------------------------------------------

OPERATIONS = (
    "ADD", "SUB", "AND", "IOR", "XOR", "COM", "DEC", "INC", "CLR", "MOV", "MOVWF", "RLF", "RRF", "SWA", "BCF",
    "BSF", "BTFSC", "BTFSS",
)  # fmt: skip
"""Mnemonics, or their first three letters: `result` in chip.c computes them."""
SAME_AS = {"RETLW": "MOV", "RETFIE": "BSF", "TRIS": "MOVWF", "OPTION": "MOVWF"}
GLITCH = 10
"""Cycles for which a pin may be driven with an unknown level before the first pulse."""
FLOWS = ["undefined", "next", "skip", "jump", "call", "return", "CLRWDT", "SLEEP"]
NO_FLOW, NEXT, SKIP, JUMP, CALL, RETURN, CLRWDT, SLEEP = range(8)
STATUS_BITS = {"C": C, "D": DC, "Z": Z}
FLOW, OP, ADDRESS, SLOT, READS_F, K, X, FLAGS, TO_W, TO_F, IS_CUT = range(11)
"""The columns of the decoded program: `ADDRESS` is the file register's, -1 if it has none or `SLOT` is it;
`X` is a number, or one of these:
"""
X_IS_W, X_IS_CARRY = -1, -2
MEMO, SPREAD = 1 << 16, 0x2545F4914F6CDD1D
EEPROM_READ, EEPROM_WRITTEN = 64, 65
"""After the cells of the EEPROM: whether one was read, and whether a write began."""


class ChipSurroundings(NamedTuple):
    """What is around the chip. Pins are bits of a word."""

    limit: int
    """In this cycle a run must have come to a cut."""
    period: int
    channels: int
    """The pins with servos, or those that are watched."""
    buttons: int
    held: int
    """Pins that are held, at these levels."""
    levels: int
    watchdog: int
    """The shortest period of the watchdog in cycles; 0 if it is off."""
    longest_write: int = 0
    """The longest EEPROM write in cycles."""
    bus: int = 0
    """The pins of a tape: SCL, and RA4 as SDA; of its EEPROM the bytes, how many of them are known, and in
    cycles what SCL has to be low, and high, at least.
    """
    size: int = 0
    recorded: int = 0
    low_time: int = 0
    high_time: int = 0
    restart: int = 0
    """The pin that is wired to another chip's MCLR,"""
    pulled: int = 0
    """and for how many cycles it has to be low, once, before the wire is read."""


def _header() -> str:
    """Return the text of `layout.h`."""
    numbers = {name: value for name, value in globals().items() if name.isupper() and isinstance(value, int)}
    numbers |= {f"DO_{name}": number for number, name in enumerate(OPERATIONS)}
    return constants(numbers) + struct("Board", dict.fromkeys(ChipSurroundings._fields, 1))


NATIVE = Native(Path(__file__).parent, "chip", _header)
