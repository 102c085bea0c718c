"""The data EEPROM: EECON1, EECON2's two keys, and a write with its duration. Compiled.

DS35007 section 3. A write starts only with the sequence of section 3.2, exact to the cycle: 55h to EECON2,
AAh two cycles later, WR in the cycle after that, with WREN already set.
"""

from __future__ import annotations

from servogen.pic.device import EEPROM_BYTES, masks
from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.interrupts import EEIF, note_flags
from servogen.simulator.layout import (
    EE_BYTE,
    EE_CELL,
    EE_DONE_AT,
    EE_STEP,
    EE_STEP_AT,
    EE_TIME,
    EEADR,
    EEADR_UNKNOWN,
    EECON1,
    EECON1_ADDRESS,
    EECON1_UNKNOWN,
    EEDATA,
    EEDATA_UNKNOWN,
    EEPROM,
    NEVER,
    SOURCE_EEADR,
    SOURCE_NO_CELL,
    USE_EEPROM,
    USE_REGISTER,
    WARN_EE_ADDRESS,
    WARN_EE_SEQUENCE,
    WRERR,
)
from servogen.simulator.unknown import use
from servogen.simulator.warn import warn

RD, WR, WREN = masks("RD", "WR", "WREN")
CELLS = EEPROM_BYTES
FIRST_KEY, SECOND_KEY = 0x55, 0xAA
KEY_TO_KEY, KEY_TO_WR = 2, 1
"""Cycles between the writes of the sequence: MOVLW stands between the keys, nothing before WR."""


@compiled
def eecon2_write(s: Vector, cycle: int, value: int) -> None:
    """Note a step of the unlock sequence: 55h, then AAh in the right cycle (DS35007 section 3.2)."""
    if value == SECOND_KEY and s[EE_STEP] == 1 and cycle == s[EE_STEP_AT] + KEY_TO_KEY:
        s[EE_STEP] = 2
    elif value == FIRST_KEY:
        s[EE_STEP] = 1
    else:
        s[EE_STEP] = 0
    s[EE_STEP_AT] = cycle


@compiled
def eecon1_write(s: Vector, cycle: int, value: int, unknown: int) -> None:
    """Write EECON1: WR and RD can be set, but not cleared, by software (section 3, register EECON1)."""
    if unknown & (EEIF | WREN | WR | RD):
        use(s, USE_REGISTER, EECON1_ADDRESS, unknown >> 8)
    s[EECON1_UNKNOWN] = unknown & WRERR
    before = s[EECON1]
    now = (value & (EEIF | WRERR | WREN)) | (before & WR)
    if value & WR and not before & WR:
        if before & WREN and s[EE_STEP] == 2 and cycle == s[EE_STEP_AT] + KEY_TO_WR:
            now |= WR
            s[EE_DONE_AT] = cycle + 1 + s[EE_TIME]
            s[EE_CELL] = s[EEADR]
            s[EE_BYTE] = s[EEDATA]
            if s[EEADR_UNKNOWN] | s[EEDATA_UNKNOWN]:
                use(s, USE_EEPROM, 0, (s[EEADR_UNKNOWN] if s[EEADR_UNKNOWN] else s[EEDATA_UNKNOWN]) >> 8)
        else:
            warn(s, WARN_EE_SEQUENCE, 0)
        s[EE_STEP] = 0
    if value & RD:
        s[EEDATA] = cell_read(s)
    s[EECON1] = now
    note_flags(s, cycle + 1)


@compiled
def cell_read(s: Vector) -> int:
    s[EEDATA_UNKNOWN] = 0xFF | SOURCE_EEADR << 8 if s[EEADR_UNKNOWN] else 0
    if s[EEADR] >= CELLS:
        s[EEDATA_UNKNOWN] = 0xFF | SOURCE_NO_CELL << 8
        warn(s, WARN_EE_ADDRESS, s[EEADR])
        return 0
    cell = s[EEPROM + s[EEADR]]
    s[EEDATA_UNKNOWN] |= cell >> 8
    return cell & 0xFF


@compiled
def write_done(s: Vector) -> None:
    """Complete the write in progress, in the cycle `EE_DONE_AT`."""
    cycle = s[EE_DONE_AT]
    s[EE_DONE_AT] = NEVER
    if s[EE_CELL] < CELLS:
        s[EEPROM + s[EE_CELL]] = s[EE_BYTE]
    else:
        warn(s, WARN_EE_ADDRESS, s[EE_CELL])
    s[EECON1] = (s[EECON1] & ~WR) | EEIF
    note_flags(s, cycle)


@compiled
def reset_eecon1(s: Vector) -> None:
    """Abort a write in progress at a reset and set WRERR; in this model the cell keeps its old value."""
    if s[EE_DONE_AT] != NEVER:
        s[EECON1_UNKNOWN] = 0
    broken = WRERR if s[EE_DONE_AT] != NEVER else s[EECON1] & WRERR
    s[EE_DONE_AT] = NEVER
    s[EE_STEP] = 0
    s[EECON1] = broken
