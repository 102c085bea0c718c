/* The data EEPROM: EECON1, EECON2's two keys, and a write with its duration.

   DS35007 section 3. A write starts only with the sequence of section 3.2, exact to the cycle: 55h to EECON2,
   AAh two cycles later, WR in the cycle after that, with WREN already set. */

#ifndef EEPROM_H
#define EEPROM_H

#include "interrupts.h"
#include "warn.h"

enum {
    FIRST_KEY = 0x55,
    SECOND_KEY = 0xAA,
    KEY_TO_KEY = 2, /* cycles between the writes of the sequence: MOVLW stands between the keys, */
    KEY_TO_WR = 1,  /* nothing before WR */
};

/* Returns the unknown bits of EECON1. */
static inline i64 unknown_of_eecon1(const Chip *s)
{
    return s->eecon1_unknown ? s->eecon1_unknown | SOURCE_WRERR << 8 : 0;
}

/* Notes a step of the unlock sequence: 55h, then AAh in the right cycle (DS35007 section 3.2). */
static void eecon2_write(Chip *s, i64 cycle, i64 value)
{
    if (value == SECOND_KEY && s->ee_step == 1 && cycle == s->ee_step_at + KEY_TO_KEY)
        s->ee_step = 2;
    else
        s->ee_step = value == FIRST_KEY;
    s->ee_step_at = cycle;
}

static i64 cell_read(Chip *s)
{
    s->eedata_unknown = s->eeadr_unknown ? 0xFF | SOURCE_EEADR << 8 : 0;
    if (s->eeadr >= EEPROM_BYTES) {
        s->eedata_unknown = 0xFF | SOURCE_NO_CELL << 8;
        warn(s, WARN_EE_ADDRESS, s->eeadr);
        return 0;
    }
    i64 cell = s->eeprom[s->eeadr];
    s->eedata_unknown |= cell >> 8;
    return cell & 0xFF;
}

/* Writes EECON1: WR and RD can be set, but not cleared, by software (section 3, register EECON1). */
static void eecon1_write(Chip *s, i64 cycle, i64 value, i64 unknown)
{
    if (unknown & (EEIF | WREN | WR | RD))
        use(s, USE_REGISTER, EECON1_ADDRESS, unknown >> 8);
    s->eecon1_unknown = unknown & WRERR;
    i64 before = s->eecon1;
    i64 now = (value & (EEIF | WRERR | WREN)) | (before & WR);
    if (value & WR && !(before & WR)) {
        if (before & WREN && s->ee_step == 2 && cycle == s->ee_step_at + KEY_TO_WR) {
            now |= WR;
            s->ee_done_at = cycle + 1 + s->ee_time;
            s->ee_cell = s->eeadr;
            s->ee_byte = s->eedata;
            if (s->eeadr_unknown | s->eedata_unknown)
                use(s, USE_EEPROM, 0, (s->eeadr_unknown ? s->eeadr_unknown : s->eedata_unknown) >> 8);
        } else {
            warn(s, WARN_EE_SEQUENCE, 0);
        }
        s->ee_step = 0;
    }
    if (value & RD)
        s->eedata = cell_read(s);
    s->eecon1 = now;
    note_flags(s, cycle + 1);
}

/* Completes the write in progress, in the cycle `ee_done_at`. */
static void write_done(Chip *s)
{
    i64 cycle = s->ee_done_at;
    s->ee_done_at = NEVER;
    if (s->ee_cell < EEPROM_BYTES)
        s->eeprom[s->ee_cell] = s->ee_byte;
    else
        warn(s, WARN_EE_ADDRESS, s->ee_cell);
    s->eecon1 = (s->eecon1 & ~WR) | EEIF;
    note_flags(s, cycle);
}

/* Aborts a write in progress at a reset and sets WRERR; in this model the cell keeps its old value. */
static void reset_eecon1(Chip *s)
{
    bool writing = s->ee_done_at != NEVER;
    if (writing)
        s->eecon1_unknown = 0;
    s->eecon1 = writing ? WRERR : s->eecon1 & WRERR;
    s->ee_done_at = NEVER;
    s->ee_step = 0;
}

#endif
