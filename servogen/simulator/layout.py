"""The layout of the machine's complete state in one vector of integers.

The compiled instruction loop works on one int64 vector, which a snapshot copies. Slots 0 to 127 are the file
registers by address in bank 0 (bank 1 mirrors the RAM: DS35007 section 2.2), of which only the RAM is used;
the special function registers have slots of their own, because few of them are plain bytes. Ports are 13 bits
wide here, bit n being pin n of `edges.PINS`: port A in bits 0 to 4, port B in 5 to 12.
"""

from __future__ import annotations

NEVER = 1 << 62
"""A cycle that is never reached."""

NOT_WRITTEN = 0x100
"""Set in a RAM slot until the program writes the byte."""
UNKNOWN_SHIFT = 9
"""A RAM slot's bits above this hold what is unknown of the byte: see unknown.py."""

RAM_SLOTS = 128

(
    # the processor
    CYCLE,
    PC,
    W,
    STATUS,
    FSR,
    PCLATH,
    INTCON,
    OPTION,
    SLEEPING,
    IN_RESET,
    # what the instruction loop must stop for: see events.py
    HORIZON,
    IRQ_AT,
    START_UP,
    AWAKE_AT,
    # TMR0, prescaler, watchdog: see timer.py
    T0_AT,
    T0_VALUE,
    T0_TICK,
    T0_FLAGGED,
    T0_HELD,
    T0_PHASE,
    PRESCALER,
    WDT_AT,
    WDT_PERIOD,
    # ports: see ports.py
    LATCH,
    TRIS,
    PINS,
    RB_OLD,
    EXT_MASK,
    EXT_LEVEL,
    DRIVEN,
    DRIVEN_HIGH,
    RA4_PULLED_UP,
    FLOATING,
    # data EEPROM: see eeprom.py
    EEDATA,
    EEADR,
    EECON1,
    EE_STEP,
    EE_STEP_AT,
    EE_DONE_AT,
    EE_CELL,
    EE_BYTE,
    EE_TIME,
    # the stack and its statistics
    SP,
    DEPTH,
    DEEPEST,
    OVERFLOWS,
    UNDERFLOWS,
    # counts for the report
    RESETS_MCLR,
    RESETS_MCLR_SLEEP,
    RESETS_WDT,
    WAKES_WDT,
    WAKES_INTERRUPT,
    INTERRUPTS,
    EDGES_TOTAL,
    # buffers shared with the host
    STIM_NEXT,
    STIM_COUNT,
    STIM_KNOWN,
    EDGE_COUNT,
    EDGE_LIMIT,
    TRACE_COUNT,
    TRACE_ROOM,
    WARN_COUNT,
    # bits whose value differs between chips: see unknown.py
    TRACKED,
    HERE,
    W_UNKNOWN,
    STATUS_UNKNOWN,
    FSR_UNKNOWN,
    T0_UNKNOWN,
    PRESCALER_UNKNOWN,
    EEDATA_UNKNOWN,
    EEADR_UNKNOWN,
    EECON1_UNKNOWN,
    INTCON_UNKNOWN,
    PINS_UNKNOWN,
    LATCH_UNKNOWN,
    RB_OLD_UNKNOWN,
    DRIVEN_UNKNOWN,
    USE_KIND,
    USE_SUBJECT,
    USE_SOURCE,
    USE_PLACE,
    USE_CYCLE,
    WDT_SHORTEST,
    WDT_CLEARED,
    WDT_EARLIEST,
    # of the prover: see abstract.py
    ANY_INPUT,
    OPTION_WRITES,
) = range(RAM_SLOTS, RAM_SLOTS + 87)

STACK = 216  # 8 levels: DS35007 section 2.4.1
EEPROM = 224  # 64 bytes: DS35007 section 3
VISIT = EEPROM
"""The slots that are noted at a breakpoint: all but the EEPROM and what serves reports."""
WARNINGS = 288
WARNING_SLOTS, WARNING_FIELDS = 64, 3
"""Each warning is three slots: its code and subject, the cycle in which it was first due, and the address
of the instruction."""
READ_UNWRITTEN = WARNINGS + WARNING_FIELDS * WARNING_SLOTS
"""By address: whether the RAM byte was read before it was ever written."""
DRIVEN_FROM = READ_UNWRITTEN + RAM_SLOTS
"""By pin, two slots: the cycle from which it has been driven with an unknown latch (DRIVEN_UNKNOWN), and the
address of the instruction."""
SLOTS = DRIVEN_FROM + 2 * 13

GLITCH = 10
"""The maximum cycles for which a pin may be driven at an unknown level before it is written low: no servo
responds to such a short pulse."""

T0CS, T0SE, PSA, PS = 0x20, 0x10, 0x08, 0x07  # of OPTION_REG: DS35007 section 2.3.2
GIE, T0IE, T0IF, INTF, RBIF = 0x80, 0x20, 0x04, 0x02, 0x01  # of INTCON: DS35007 section 2.3.3

# Edges and stimuli travel as cycle << 8 | pin << 2 | level.
PACK_CYCLE, PACK_PIN, PACK_LEVELS = 8, 2, 3
MCLR_PIN = 13
"""The number of the reset pin in a stimulus, after the thirteen of `edges.PINS`."""

# The memo of regions (memo.py), one vector of rows; and the nested regions being recorded.
MEMO_ROWS, MEMO_COLUMNS = 1 << 12, 5
UNKNOWN = -1
DEEPEST_RECORDING, RECORD = 8, 4
REGION_BYTES = 7
"""The maximum RAM bytes of a region, because they are a key of 63 bits in the memo."""
REGION = 1 + REGION_BYTES

# Reasons why the instruction loop returns to the host.
GOES_ON, AT_END, EDGES_FULL, AT_BREAKPOINT, NEEDS_STIMULUS, TRACE_FULL = range(6)

# What a warning is about.
(
    WARN_DRIVEN_UNWRITTEN,
    WARN_CONTENTION,
    WARN_UNDEFINED,
    WARN_ERASED,
    WARN_STACK_OVERFLOW,
    WARN_STACK_UNDERFLOW,
    WARN_EE_SEQUENCE,
    WARN_EE_ADDRESS,
    WARN_WATCHDOG,
) = range(9)

# Sources of unknown bits (unknown.py). 0x0C to 0x4F are the RAM bytes; pins are added to FLOATING_PIN and
# UNWRITTEN_LATCH.
SOURCE_W, SOURCE_FSR, SOURCE_FLAGS, SOURCE_TMR0, SOURCE_EEDATA, SOURCE_EEADR, SOURCE_WRERR = range(1, 8)
SOURCE_RB_CHANGE, SOURCE_NO_CELL, SOURCE_PRESCALER = 8, 9, 10
FLOATING_PIN, UNWRITTEN_LATCH = 0x50, 0x60
SOURCE_PHASE = 0x70
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
