"""Reads and writes of the special function registers that are more than a byte. Compiled.

DS35007 section 2.3, table 2-1. Addresses have the bank in bit 7. PCL, STATUS and INDF are the instruction
loop's own; unimplemented addresses and EECON2 read as 0. A read happens in Q2 of its cycle, a write in Q4.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.eeprom import eecon1_write, eecon2_write
from servogen.simulator.interrupts import note_flags
from servogen.simulator.layout import (
    EEADR,
    EECON1,
    EEDATA,
    FSR,
    INTCON,
    OPTION,
    PCLATH,
    PINS,
    RB_OLD,
    TRIS,
)
from servogen.simulator.ports import B_SHIFT, A, B, compare, port_write, settle, tris_write
from servogen.simulator.timer import option_write, t0_read, t0_sync, t0_write

BANK_1 = 0x80


@compiled
def read_register(s: Vector, address: int, at: int) -> int:
    low = address & 0x7F
    if low == 0x06:
        if address & BANK_1:
            return s[TRIS] >> B_SHIFT
        s[RB_OLD] = s[PINS]
        return s[PINS] >> B_SHIFT
    if low == 0x05:
        return (s[TRIS] if address & BANK_1 else s[PINS]) & A
    if low == 0x0B:
        t0_sync(s, at)
        return s[INTCON]
    if low == 0x04:
        return s[FSR]
    if low == 0x01:
        return s[OPTION] if address & BANK_1 else t0_read(s, at)
    if low == 0x0A:
        return s[PCLATH]
    if low == 0x08:
        return s[EECON1] if address & BANK_1 else s[EEDATA]
    if address == 0x09:
        return s[EEADR]
    return 0


@compiled
def write_register(s: Vector, edges: Vector, address: int, at: int, value: int) -> bool:
    """Returns whether events or interrupts may have moved, so that the loop must look at them anew."""
    low = address & 0x7F
    if low == 0x04:
        s[FSR] = value
        return False
    if low == 0x0A:
        s[PCLATH] = value & 0x1F
        return False
    if low == 0x06 or low == 0x05:
        port = B if low == 0x06 else A
        if address & BANK_1:
            tris_write(s, edges, at, port, value)
        else:
            port_write(s, edges, at, port, value)
    elif low == 0x0B:
        t0_sync(s, at)
        s[INTCON] = value
        compare(s)
        note_flags(s, at + 1)
    elif low == 0x01:
        if address & BANK_1:
            write_option(s, at, value)
        else:
            t0_write(s, at, value)
    elif address == 0x08:
        s[EEDATA] = value
    elif address == 0x88:
        eecon1_write(s, at, value)
    elif address == 0x09:
        s[EEADR] = value
    elif address == 0x89:
        eecon2_write(s, at, value)
    return True


@compiled
def write_option(s: Vector, at: int, value: int) -> None:
    """OPTION_REG, by either instruction: prescaler, timer and pull-ups change in the next cycle."""
    option_write(s, at + 1, value)
    settle(s, at + 1)
