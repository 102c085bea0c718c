"""Reads and writes of the special function registers that are more than a byte. Compiled.

DS35007 section 2.3, table 2-1. Addresses have the bank in bit 7. PCL, STATUS and INDF are handled by the
instruction loop itself; unimplemented addresses and EECON2 read as 0. A read happens in Q2 of its cycle, a
write in Q4.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.eeprom import eecon1_write, eecon2_write
from servogen.simulator.interrupts import note_flags
from servogen.simulator.layout import (
    EEADR,
    EEADR_ADDRESS,
    EEADR_UNKNOWN,
    EECON1,
    EECON1_ADDRESS,
    EECON2_ADDRESS,
    EEDATA,
    EEDATA_ADDRESS,
    EEDATA_UNKNOWN,
    FSR,
    FSR_ADDRESS,
    FSR_UNKNOWN,
    INTCON,
    INTCON_ADDRESS,
    INTCON_UNKNOWN,
    OPTION,
    OPTION_ADDRESS,
    PCLATH,
    PCLATH_ADDRESS,
    PINS,
    PINS_UNKNOWN,
    PORTA_ADDRESS,
    PORTB_ADDRESS,
    TMR0_ADDRESS,
    TMR0_UNKNOWN,
    TRACKED,
    TRIS,
    USE_REGISTER,
)
from servogen.simulator.ports import (
    B_SHIFT,
    A,
    B,
    compare,
    port_write,
    read_port_b,
    settle,
    tris_write,
    unknown_of_port,
)
from servogen.simulator.timer import option_write, t0_read, t0_runs, t0_sync, t0_write
from servogen.simulator.unknown import doubt, flags_in_doubt, source_of_flag, use, wrerr_source

BANK_1 = 0x80


@compiled
def read_register(s: Vector, address: int, at: int, bits: int) -> int:
    """Return a register's value and, above bit 7, its unknown bits with the source of one of `bits`."""
    low = address & 0x7F
    if low == PORTB_ADDRESS:
        if address & BANK_1:
            return s[TRIS] >> B_SHIFT
        read_port_b(s)
        return s[PINS] >> B_SHIFT | unknown_of_port(s, B, bits) << 8
    if low == PORTA_ADDRESS:
        if address & BANK_1:
            return s[TRIS] & A
        return s[PINS] & A | unknown_of_port(s, A, bits) << 8
    if low == INTCON_ADDRESS:
        t0_sync(s, at)
        unknown = s[INTCON_UNKNOWN]
        if unknown:
            unknown |= source_of_flag(s, unknown & bits if unknown & bits else unknown) << 8
        return s[INTCON] | unknown << 8
    if low == FSR_ADDRESS:
        return s[FSR] | s[FSR_UNKNOWN] << 8
    if low == TMR0_ADDRESS:
        return s[OPTION] if address & BANK_1 else t0_read(s, at) | s[TMR0_UNKNOWN] << 8
    if low == PCLATH_ADDRESS:
        return s[PCLATH]
    if low == EEDATA_ADDRESS:
        if address & BANK_1:
            return s[EECON1] | wrerr_source(s) << 8
        return s[EEDATA] | s[EEDATA_UNKNOWN] << 8
    if address == EEADR_ADDRESS:
        return s[EEADR] | s[EEADR_UNKNOWN] << 8
    return 0


@compiled
def write_register(s: Vector, edges: Vector, address: int, at: int, value: int, unknown: int) -> bool:
    """Write a register; return whether events or interrupts may have moved, so that the loop must check them
    again.

    `unknown` holds the unknown bits of `value`.
    """
    low = address & 0x7F
    if low == FSR_ADDRESS:
        s[FSR] = value
        s[FSR_UNKNOWN] = unknown
        return False
    if low == PCLATH_ADDRESS:
        s[PCLATH] = value & 0x1F
        if unknown & 0x1F:
            use(s, USE_REGISTER, address, unknown >> 8)
        return False
    if low == PORTB_ADDRESS or low == PORTA_ADDRESS:  # noqa: SIM109 - a tuple is an object in compiled code
        port = B if low == PORTB_ADDRESS else A
        if address & BANK_1:
            tris_write(s, edges, at, port, value, unknown)
        else:
            port_write(s, edges, at, port, value, unknown)
    elif low == INTCON_ADDRESS:
        t0_sync(s, at)
        s[INTCON] = value
        s[INTCON_UNKNOWN] = unknown & 0x07
        if unknown & 0xF8:
            use(s, USE_REGISTER, address, unknown >> 8)
        compare(s)
        if s[TRACKED]:
            flags_in_doubt(s, s[PINS_UNKNOWN])
            doubt(s, t0_runs(s))
        note_flags(s, at + 1)
    elif low == TMR0_ADDRESS:
        if address & BANK_1:
            write_option(s, at, value, unknown)
        else:
            t0_write(s, at, value, unknown)
            if s[TRACKED]:
                flags_in_doubt(s, s[PINS_UNKNOWN])
                doubt(s, t0_runs(s))
    elif address == EEDATA_ADDRESS:
        s[EEDATA] = value
        s[EEDATA_UNKNOWN] = unknown
    elif address == EECON1_ADDRESS:
        eecon1_write(s, at, value, unknown)
    elif address == EEADR_ADDRESS:
        s[EEADR] = value
        s[EEADR_UNKNOWN] = unknown
    elif address == EECON2_ADDRESS:
        if unknown:
            use(s, USE_REGISTER, address, unknown >> 8)
        eecon2_write(s, at, value)
    return True


@compiled
def write_option(s: Vector, at: int, value: int, unknown: int) -> None:
    """Write OPTION_REG, by either instruction: prescaler, timer and pull-ups change in the next cycle."""
    if unknown:
        use(s, USE_REGISTER, OPTION_ADDRESS, unknown >> 8)
    option_write(s, at + 1, value)
    settle(s, at + 1)
    if s[TRACKED]:
        doubt(s, t0_runs(s))
