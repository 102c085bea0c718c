/* Reads and writes of the special function registers that are more than a byte, and the stack.

   DS35007 section 2.3, table 2-1. Addresses have the bank in bit 7. PCL, STATUS and INDF are handled by the
   instruction loop itself; unimplemented addresses and EECON2 read as 0. A read happens in Q2 of its cycle, a
   write in Q4. */

#ifndef REGISTERS_H
#define REGISTERS_H

#include "eeprom.h"
#include "ports.h"

enum { BANK_1 = 0x80 };

/* Returns a register's value and, above bit 7, its unknown bits with the source of one of `bits`. */
CALLED i64 read_register(Chip *s, i64 address, i64 at, i64 bits)
{
    bool bank_1 = address & BANK_1;
    switch (address & 0x7F) {
    case PORTB_ADDRESS:
        if (bank_1)
            return s->tris >> B_SHIFT;
        read_port_b(s);
        return s->pins >> B_SHIFT | unknown_of_port(s, PORT_B, bits) << 8;
    case PORTA_ADDRESS:
        if (bank_1)
            return s->tris & PORT_A;
        return (s->pins & PORT_A) | unknown_of_port(s, PORT_A, bits) << 8;
    case INTCON_ADDRESS: {
        t0_sync(s, at);
        i64 unknown = s->intcon_unknown;
        if (unknown)
            unknown |= source_of_flag(s, unknown & bits ? unknown & bits : unknown) << 8;
        return s->intcon | unknown << 8;
    }
    case FSR_ADDRESS:
        return s->fsr | s->fsr_unknown << 8;
    case TMR0_ADDRESS:
        return bank_1 ? s->option : t0_read(s, at) | s->tmr0_unknown << 8;
    case PCLATH_ADDRESS:
        return s->pclath;
    case EEDATA_ADDRESS:
        return bank_1 ? s->eecon1 | unknown_of_eecon1(s) << 8 : s->eedata | s->eedata_unknown << 8;
    case EEADR_ADDRESS:
        return bank_1 ? 0 : s->eeadr | s->eeadr_unknown << 8;
    default:
        return 0;
    }
}

/* Writes OPTION_REG, by either instruction: prescaler, timer and pull-ups change in the next cycle. */
static void write_option(Chip *s, i64 at, i64 value, i64 unknown)
{
    if (unknown)
        use(s, USE_REGISTER, OPTION_ADDRESS, unknown >> 8);
    option_write(s, at + 1, value);
    settle(s, at + 1);
    if (s->tracked)
        doubt(s, t0_runs(s));
}

static void write_intcon(Chip *s, i64 address, i64 at, i64 value, i64 unknown)
{
    t0_sync(s, at);
    s->intcon = value;
    s->intcon_unknown = unknown & 0x07;
    if (unknown & 0xF8)
        use(s, USE_REGISTER, address, unknown >> 8);
    compare(s);
    if (s->tracked) {
        flags_in_doubt(s, s->pins_unknown);
        doubt(s, t0_runs(s));
    }
    note_flags(s, at + 1);
}

/* Writes a register; returns whether events or interrupts may have moved, so that the loop must check them
   again.

   `unknown` holds the unknown bits of `value`. */
CALLED bool write_register(Chip *s, i64 *edges, i64 address, i64 at, i64 value, i64 unknown)
{
    bool bank_1 = address & BANK_1;
    i64 low = address & 0x7F;
    if (low == FSR_ADDRESS) {
        s->fsr = value;
        s->fsr_unknown = unknown;
        return false;
    }
    if (low == PCLATH_ADDRESS) {
        s->pclath = value & 0x1F;
        if (unknown & 0x1F)
            use(s, USE_REGISTER, address, unknown >> 8);
        return false;
    }
    if (low == PORTB_ADDRESS || low == PORTA_ADDRESS) {
        i64 port = low == PORTB_ADDRESS ? PORT_B : PORT_A;
        if (bank_1)
            tris_write(s, edges, at, port, value, unknown);
        else
            port_write(s, edges, at, port, value, unknown);
    } else if (low == INTCON_ADDRESS) {
        write_intcon(s, address, at, value, unknown);
    } else if (low == TMR0_ADDRESS && bank_1) {
        write_option(s, at, value, unknown);
    } else if (low == TMR0_ADDRESS) {
        t0_write(s, at, value, unknown);
        if (s->tracked) {
            flags_in_doubt(s, s->pins_unknown);
            doubt(s, t0_runs(s));
        }
    } else if (address == EEDATA_ADDRESS) {
        s->eedata = value;
        s->eedata_unknown = unknown;
    } else if (address == EECON1_ADDRESS) {
        eecon1_write(s, at, value, unknown);
    } else if (address == EEADR_ADDRESS) {
        s->eeadr = value;
        s->eeadr_unknown = unknown;
    } else if (address == EECON2_ADDRESS) {
        if (unknown)
            use(s, USE_REGISTER, address, unknown >> 8);
        eecon2_write(s, at, value);
    }
    return true;
}

/* Pushes a return address; a ninth overwrites the first: the stack is a ring (DS35007 section 2.4.1). */
static inline void push(Chip *s, i64 address)
{
    s->stack[s->sp] = address;
    s->sp = (s->sp + 1) & (STACK_LEVELS - 1);
    if (s->depth == STACK_LEVELS) {
        s->overflows += 1;
        warn(s, WARN_STACK_OVERFLOW, 0);
    } else {
        s->depth += 1;
        s->deepest = max(s->deepest, s->depth);
    }
}

/* Returns the latest return address. */
static inline i64 pop(Chip *s)
{
    s->sp = (s->sp - 1) & (STACK_LEVELS - 1);
    if (s->depth == 0) {
        s->underflows += 1;
        warn(s, WARN_STACK_UNDERFLOW, 0);
    } else {
        s->depth -= 1;
    }
    return s->stack[s->sp];
}

#endif
