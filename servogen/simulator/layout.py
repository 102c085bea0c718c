"""The layout of the machine's complete state in one vector of integers.

The instruction loop, which is in C (`core/`), works on one int64 vector, which a snapshot copies. Slots 0 to
127 are the file registers by address in bank 0 (bank 1 mirrors the RAM: DS35007 section 2.2), of which only
the RAM is used; the special function registers have slots of their own, because few of them are plain bytes.
Ports are 13 bits wide here, bit n being pin n of `edges.PINS`: port A in bits 0 to 4, port B in 5 to 12.

`ROWS` has one row per register, count and time in the vector. Power-up, start values, the fingerprint, the
prover's states and certificates and the texts of warnings are derived from it; so are, by `core/__init__.py`,
the struct and the constants of the C: each number in capitals here has the same name there.
"""

from __future__ import annotations

from types import MappingProxyType

from servogen.pic.device import EEPROM_BYTES, STACK_LEVELS, masks, registers
from servogen.simulator.slots import ALL_PINS, Future, SlotTable

NEVER = 1 << 62
"""A cycle that is never reached."""

NOT_WRITTEN = 0x100
"""Set in a RAM slot until the program writes the byte."""
UNKNOWN_SHIFT = 9
"""A RAM slot's bits above this hold what is unknown of the byte: see unknown.h."""

RAM_SLOTS = 128

RA4, RB0, RB4_TO_7, PORT_B = 1 << 4, 1 << 5, 0xF0 << 5, 0xFF << 5
C_DC_Z = sum(masks("C", "DC", "Z"))
T0CS, T0SE, PSA = masks("T0CS", "T0SE", "PSA")
PS = sum(masks("PS2", "PS1", "PS0"))
GIE, EEIE, T0IE, T0IF, INTF, RBIF = masks("GIE", "EEIE", "T0IE", "T0IF", "INTF", "RBIF")
EEIF, WRERR, WR = masks("EEIF", "WRERR", "WR")
TO, PD = masks("TO", "PD")

_table = SlotTable()
_table.block("FILE", RAM_SLOTS)

# The processor. Start values are drawn in the order of the rows (`--start-seed`).
CYCLE = _table.add("CYCLE")
PC = _table.add("PC", Future.VALUE, register="PCL", bits=0x1FFF)
W, W_UNKNOWN = _table.add_uncertain("W", undefined=0xFF, start="w", source="W", merged=True)
STATUS, STATUS_UNKNOWN = _table.add_uncertain(
    "STATUS",
    register="STATUS",
    power_up=0x18,
    undefined=C_DC_Z,
    start="flags",
    source="C, DC or Z",
    merged=True,
)
FSR, FSR_UNKNOWN = _table.add_uncertain(
    "FSR", register="FSR", undefined=0xFF, start="fsr", source="FSR", merged=True
)
PCLATH = _table.add("PCLATH", Future.VALUE, register="PCLATH", bits=0x1F)
OPTION = _table.add("OPTION", Future.VALUE, register="OPTION_REG", power_up=0xFF)
SLEEPING = _table.add("SLEEPING", Future.VALUE)
IN_RESET = _table.add("IN_RESET", Future.VALUE)

# What the instruction loop must stop for: see events.h.
HORIZON = _table.add("HORIZON")
IRQ_AT = _table.add("IRQ_AT", Future.MOMENT, power_up=NEVER)
START_UP = _table.add("START_UP")
AWAKE_AT = _table.add("AWAKE_AT", Future.UNTIL)

# TMR0, prescaler, watchdog: see timer.h.
T0_AT = _table.add("T0_AT", Future.UNTIL, timed=True)
TMR0, TMR0_UNKNOWN = _table.add_uncertain(
    "TMR0", register="TMR0", undefined=0xFF, start="tmr0", source="TMR0", timed=True
)
T0_TICK = _table.add("T0_TICK", Future.MOMENT, power_up=NEVER, timed=True)
T0_FLAGGED = _table.add("T0_FLAGGED", Future.SPECIAL, power_up=-1, timed=True)
T0_HELD = _table.add("T0_HELD", Future.UNTIL, timed=True)
T0_PHASE = _table.add("T0_PHASE")
PRESCALER, PRESCALER_UNKNOWN = _table.add_uncertain("PRESCALER", timed=True)
WDT_AT = _table.add("WDT_AT", Future.SINCE, timed=True)
WDT_PERIOD = _table.add("WDT_PERIOD")
WDT_SHORTEST = _table.add("WDT_SHORTEST")
WDT_CLEARED = _table.add("WDT_CLEARED", Future.SINCE, timed=True, other_chips=True)
WDT_EARLIEST = _table.add("WDT_EARLIEST", Future.MOMENT, power_up=NEVER, timed=True, other_chips=True)

# Data EEPROM: see eeprom.h.
EEDATA, EEDATA_UNKNOWN = _table.add_uncertain(
    "EEDATA", register="EEDATA", undefined=0xFF, start="eedata", source="EEDATA", merged=True
)
EEADR, EEADR_UNKNOWN = _table.add_uncertain(
    "EEADR", register="EEADR", undefined=0xFF, start="eeadr", source="EEADR"
)
EECON1, EECON1_UNKNOWN = _table.add_uncertain(
    "EECON1", register="EECON1", undefined=WRERR, start="wrerr", source="WRERR"
)
EE_STEP = _table.add("EE_STEP", Future.VALUE)
EE_STEP_AT = _table.add("EE_STEP_AT", Future.SPECIAL)
EE_DONE_AT = _table.add("EE_DONE_AT", Future.MOMENT, power_up=NEVER)
EE_CELL = _table.add("EE_CELL", Future.VALUE)
EE_BYTE = _table.add("EE_BYTE", Future.VALUE)
EE_TIME = _table.add("EE_TIME")

# Interrupts and ports: see interrupts.h, ports.h.
INTCON, INTCON_UNKNOWN = _table.add_uncertain("INTCON", register="INTCON", undefined=RBIF, start="rbif")
PINS, PINS_UNKNOWN = _table.add_uncertain("PINS", port="PORT")
LATCH, LATCH_UNKNOWN = _table.add_uncertain("LATCH", port="LAT", undefined=ALL_PINS, start="latches")
TRIS = _table.add("TRIS", Future.VALUE, port="TRIS", power_up=ALL_PINS)
RB_OLD, RB_OLD_UNKNOWN = _table.add_uncertain(
    "RB_OLD", bits=PORT_B, undefined=RB4_TO_7, start="rb-old", merged=True
)
EXT_MASK = _table.add("EXT_MASK", Future.STIMULUS)
EXT_LEVEL = _table.add("EXT_LEVEL", Future.STIMULUS)
DRIVEN = _table.add("DRIVEN", Future.VALUE)
DRIVEN_HIGH = _table.add("DRIVEN_HIGH", Future.VALUE)
DRIVEN_UNKNOWN = _table.add("DRIVEN_UNKNOWN", Future.VALUE, other_chips=True)
# The pins that have been driven high; since the first was, those that were inputs; of these, with a pull-up.
PULSED = _table.add("PULSED", Future.VALUE, other_chips=True)
RELEASED = _table.add("RELEASED", Future.VALUE, other_chips=True)
PULLED_UP = _table.add("PULLED_UP", Future.VALUE, other_chips=True)
# The pins with a resistor to the supply; what devices on the pins do: see devices.py.
RESISTORS = _table.add("RESISTORS", bits=ALL_PINS)
DEVICES = _table.add("DEVICES")
DEVICE_PINS = _table.add("DEVICE_PINS")
DEVICE_TOLD = _table.add("DEVICE_TOLD")
DEVICE_ANSWER = _table.add("DEVICE_ANSWER", Future.STIMULUS)
FLOATING = _table.add("FLOATING")

# The stack and its statistics.
SP = _table.add("SP", Future.SPECIAL)
DEPTH = _table.add("DEPTH", Future.SPECIAL)
DEEPEST = _table.add("DEEPEST")
OVERFLOWS = _table.add("OVERFLOWS")
UNDERFLOWS = _table.add("UNDERFLOWS")

# Counts for the report.
RESETS_MCLR = _table.add("RESETS_MCLR")
RESETS_MCLR_SLEEP = _table.add("RESETS_MCLR_SLEEP")
RESETS_WDT = _table.add("RESETS_WDT")
WAKES_WDT = _table.add("WAKES_WDT")
WAKES_INTERRUPT = _table.add("WAKES_INTERRUPT")
INTERRUPTS = _table.add("INTERRUPTS")
EDGES_TOTAL = _table.add("EDGES_TOTAL")

# Buffers shared with the host.
STIM_NEXT = _table.add("STIM_NEXT")
STIM_COUNT = _table.add("STIM_COUNT")
STIM_KNOWN = _table.add("STIM_KNOWN", power_up=NEVER)
EDGE_COUNT = _table.add("EDGE_COUNT")
EDGE_LIMIT = _table.add("EDGE_LIMIT")
TRACE_COUNT = _table.add("TRACE_COUNT")
TRACE_ROOM = _table.add("TRACE_ROOM")
WARN_COUNT = _table.add("WARN_COUNT")

# The first use of a bit whose value differs between chips: see unknown.h.
TRACKED = _table.add("TRACKED")
HERE = _table.add("HERE")
USE_KIND = _table.add("USE_KIND")
USE_SUBJECT = _table.add("USE_SUBJECT")
USE_SOURCE = _table.add("USE_SOURCE")
USE_PLACE = _table.add("USE_PLACE")
USE_CYCLE = _table.add("USE_CYCLE")

# Of the prover: see prove/chip.py.
ANY_INPUT = _table.add("ANY_INPUT")
OPTION_WRITES = _table.add("OPTION_WRITES")
DEVICE_STATE = _table.add("DEVICE_STATE", Future.VALUE)

ROWS = _table.rows()
ROW = MappingProxyType({row.name: row for row in ROWS})
UNCERTAIN = tuple((row, row.unknown) for row in ROWS if row.unknown is not None)
"""The rows whose bits may be unknown, each with the slot of its unknown bits."""
NOT_STORED = MappingProxyType({"INDF": "the register that FSR points at", "EECON2": "reads as 0"})
"""The special function registers without a row, and why they need none."""

# The addresses that compiled code compares with; OPTION_REG, TRISA, TRISB and EECON1 have the low seven bits
# of TMR0, PORTA, PORTB and EEDATA.
TMR0_ADDRESS, PCL_ADDRESS, STATUS_ADDRESS, FSR_ADDRESS, PORTA_ADDRESS, PORTB_ADDRESS, EEDATA_ADDRESS = (
    registers()[name].address for name in ("TMR0", "PCL", "STATUS", "FSR", "PORTA", "PORTB", "EEDATA")
)
EEADR_ADDRESS, PCLATH_ADDRESS, INTCON_ADDRESS, OPTION_ADDRESS, EECON1_ADDRESS, EECON2_ADDRESS = (
    registers()[name].address for name in ("EEADR", "PCLATH", "INTCON", "OPTION_REG", "EECON1", "EECON2")
)

STACK = _table.block("STACK", STACK_LEVELS)
VISIT = _table.length
"""The slots that are noted at a breakpoint: all but the EEPROM and what serves reports."""
EEPROM = _table.block("EEPROM", EEPROM_BYTES)
"""The cells, and above bit 7 what is unknown of each, which only the prover makes so."""
# Warnings about a pin, about the program as a whole, and about an address, of which there may be many.
OF_A_PIN = (WARN_DRIVEN_UNWRITTEN, WARN_CONTENTION, WARN_RELEASED, WARN_PULLED_UP) = range(4)
OF_ALL = (WARN_STACK_OVERFLOW, WARN_STACK_UNDERFLOW, WARN_EE_SEQUENCE, WARN_WATCHDOG) = range(4, 8)
OF_AN_ADDRESS = (WARN_UNDEFINED, WARN_ERASED, WARN_EE_ADDRESS) = range(8, 11)
WORD_WARNINGS, HARMLESS_WARNINGS = 40, 24
"""The warnings up to which one of an undefined word, or one of another address, is recorded."""
WARNING_SLOTS, WARNING_FIELDS = WORD_WARNINGS + 13 * len(OF_A_PIN) + len(OF_ALL), 3
"""Each warning is three slots: its code and subject, the cycle in which it was first due, and the address
of the instruction. All that are not about an address find room."""
WARNINGS = _table.block("WARNINGS", WARNING_FIELDS * WARNING_SLOTS)
READ_UNWRITTEN = _table.block("READ_UNWRITTEN", RAM_SLOTS)
"""By address: whether the RAM byte was read before it was ever written."""
DRIVEN_FROM = _table.block("DRIVEN_FROM", 2 * 13)
"""By pin, two slots: the cycle from which it has been driven with an unknown latch (DRIVEN_UNKNOWN), and the
address of the instruction."""
SLOTS = _table.length
FIELDS = _table.fields()
"""The name and the number of slots of each field, in their order: the struct of the C."""

FETCH = 1
"""Cycles from the end of a reset to the instruction at 0000h: its fetch."""
GLITCH = 10
"""The maximum cycles for which a pin may be driven at an unknown level before it is written low: no servo
responds to such a short pulse."""

# Edges and stimuli travel as cycle << 8 | pin << 2 | level.
PACK_CYCLE, PACK_PIN, PACK_LEVELS = 8, 2, 3
MCLR_PIN = 13
"""The number of the reset pin in a stimulus, after the thirteen of `edges.PINS`."""

# The memo of regions (memo.h), one vector of rows; and the nested regions being recorded.
MEMO_ROWS, MEMO_COLUMNS = 1 << 12, 5
UNKNOWN = -1
DEEPEST_RECORDING, RECORD = 8, 4
REGION_BYTES = 7
"""The maximum RAM bytes of a region, because they are a key of 63 bits in the memo."""
REGION = 1 + REGION_BYTES

# Reasons why the instruction loop returns to the host.
GOES_ON, AT_END, EDGES_FULL, AT_BREAKPOINT, NEEDS_STIMULUS, TRACE_FULL = range(6)

# Sources of unknown bits (unknown.h). 1 to 0x0B are those of the table's rows, 0x0C to 0x4F the RAM bytes;
# pins are added to FLOATING_PIN and UNWRITTEN_LATCH.
SOURCE_TMR0, SOURCE_EEADR, SOURCE_WRERR = (ROW[name].source for name in ("TMR0", "EEADR", "EECON1"))
FLOATING_PIN, UNWRITTEN_LATCH = 0x50, 0x60
SOURCE_PHASE, SOURCE_RB_CHANGE, SOURCE_NO_CELL, SOURCE_PRESCALER = range(0x70, 0x74)
PHASED = 0xFF | SOURCE_PHASE << 8
"""The unknown bits and source of a byte that is its value plus φ."""

# Kinds of use of an unknown bit; what the subject is.
(
    USE_SKIP,
    USE_JUMP,
    USE_POINTER,
    USE_OUTPUT,  # a pin
    USE_DIRECTION,  # a port, 0 or 1
    USE_BANK,
    USE_REGISTER,  # an address
    USE_EEPROM,
    USE_INTERRUPT,  # a bit of INTCON
    USE_WAKE,  # a bit of INTCON
) = range(1, 11)
