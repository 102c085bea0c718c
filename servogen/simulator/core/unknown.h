/* Values that differ between chips, and their first use.

   DS35007 table 6-4 marks with "x" what a power-on reset leaves undefined: RAM, W, FSR, TMR0, the port
   latches, EEDATA, EEADR, the bits C, DC, Z, WRERR and RBIF. An undriven pin may also read as either level.
   The simulator gives all of these a value, and a mask of the bits that could differ. The mask follows the
   data through every instruction: a bit of a result is known if no choice of the unknown bits changes it, as
   far as a single instruction shows. Copying unknown bits is harmless; only a *use* matters, by which they
   affect the program's path, its timing or its pins (its kind: layout.py). The first use is kept.

   An unknown byte travels as one integer of 16 bits: the mask, and above it the source (layout.py) of one of
   its unknown bits, for the message.

   One kind of unknown byte carries more: PHASED means that the byte is its value plus phi, modulo 256, where
   phi is one unknown number for the whole chip. The prover sets TMR0 and the bytes that follow it so, and
   thereby compares them without knowing either: phased - phased is a known number. Instructions that cannot
   keep this relation make an ordinary unknown byte of it. */

#ifndef UNKNOWN_H
#define UNKNOWN_H

#include "state.h"

/* Records what was used, where and when, unless there was an earlier use. */
RARE void use(Chip *s, i64 kind, i64 subject, i64 source)
{
    if (s->use_kind)
        return;
    s->use_kind = kind;
    s->use_subject = subject;
    s->use_source = source;
    s->use_place = s->here;
    s->use_cycle = s->cycle;
}

/* Returns the bits that a carry out of any bit of `mask` can reach, including these bits. */
static inline i64 upward(i64 mask) { return -(mask & -mask) & 0xFF; }

/* Returns an unknown byte of which `bits` have become known. */
static inline i64 without(i64 unknown, i64 bits)
{
    return unknown & 0xFF & ~bits ? unknown & ~bits : 0;
}

/* Returns the unknown bits of STATUS after a write of a byte: TO and PD stay what they were. */
static inline i64 written_status(i64 before, i64 written)
{
    i64 remaining = without(before, ~(TO | PD));
    i64 source = written >> 8 == SOURCE_PHASE ? SOURCE_TMR0 : written >> 8;
    i64 bits = written & 0xFF & ~(TO | PD);
    return remaining | bits | (bits && !remaining ? source << 8 : 0);
}

/* Returns whether the result is PHASED, for unknown bits `vu` of the operand and `wu` of W. */
static inline bool keeps_phase(i64 op, i64 vu, i64 wu)
{
    if (vu == PHASED) {
        if (op == OP_MOVF || op == OP_INCF || op == OP_DECF || op == OP_INCFSZ || op == OP_DECFSZ)
            return true;
        return (op == OP_ADDWF || op == OP_SUBWF) && (wu & 0xFF) == 0;
    }
    return wu == PHASED && (vu & 0xFF) == 0 && (op == OP_ADDWF || op == OP_ADDLW);
}

/* Returns the unknown bits of an instruction's result and, above bit 15, those of STATUS after it.

   `v`, `w` and `r` are operand, W and result; `vu`, `wu` and `su` the unknown bits of operand, W and STATUS;
   `bits` is the mask of a bit instruction. */
CALLED i64 propagate(
    i64 op, i64 bits, i64 v, i64 vu, i64 w, i64 wu, i64 su, i64 r)
{
    i64 m = vu & 0xFF, n = wu & 0xFF;
    i64 source = (m ? vu : n ? wu : su) >> 8;
    i64 flags = Z; /* those that the instruction sets */
    i64 f = 0;     /* of these, the unknown ones */
    i64 t;
    bool both = vu == PHASED && wu == PHASED;
    switch (op) {
    case OP_MOVF: case OP_COMF:
        t = m;
        break;
    case OP_ANDWF: case OP_ANDLW:
        t = (m | n) & (v | m) & (w | n);
        break;
    case OP_IORWF: case OP_IORLW:
        t = (m | n) & ~(v & ~m) & ~(w & ~n) & 0xFF;
        break;
    case OP_XORWF: case OP_XORLW:
        t = both && v == w ? 0 : m | n;
        flags = both && v != w ? 0 : Z; /* the XOR of two different bytes is not 0 */
        su = without(su, Z);
        break;
    case OP_INCF: case OP_DECF:
        t = upward(m);
        break;
    case OP_INCFSZ: case OP_DECFSZ:
        t = upward(m);
        flags = 0;
        break;
    case OP_SWAPF:
        t = (m >> 4 | m << 4) & 0xFF;
        flags = 0;
        break;
    case OP_RLF:
        t = (m << 1 | (su & C)) & 0xFF;
        source = (m ? vu : su) >> 8;
        flags = C;
        f = m >> 7;
        break;
    case OP_RRF:
        t = m >> 1 | (su & C) << 7;
        source = (m ? vu : su) >> 8;
        flags = C;
        f = m & C;
        break;
    case OP_ADDWF: case OP_ADDLW: case OP_SUBWF: case OP_SUBLW:
        t = upward(m | n);
        flags = C | DC | Z;
        f = (t ? C : 0) | (t & 0x0F ? DC : 0);
        if (both && op == OP_SUBWF)
            t = 0; /* but what is borrowed depends on phi */
        break;
    default: /* BCF and BSF */
        t = m & ~bits;
        flags = 0;
    }
    if (flags & Z && t && (r & ~t & 0xFF) == 0)
        f |= Z;
    i64 after = without(su, flags);
    if (f)
        after = (after & 0xFF) | f | (source == SOURCE_PHASE ? SOURCE_TMR0 : source) << 8;
    if (source == SOURCE_PHASE && !keeps_phase(op, vu, wu))
        source = SOURCE_TMR0;
    return (t ? t | source << 8 : 0) | after << 16;
}

/* Notes that TMR0 counted from an unknown value, so that T0IF may be set. */
static inline void timer_flag_in_doubt(Chip *s)
{
    if (!(s->intcon & T0IF & ~s->intcon_unknown))
        s->intcon_unknown |= T0IF;
}

/* Notes that inputs among `pins` (a port word) have no known level, so that noise may set INTF or clock TMR0.
   */
static inline void flags_in_doubt(Chip *s, i64 pins)
{
    if (pins & RB0 && !(s->intcon & INTF & ~s->intcon_unknown))
        s->intcon_unknown |= INTF;
    if (pins & RA4 && s->option & T0CS && !s->sleeping) {
        s->tmr0_unknown = 0xFF | (FLOATING_PIN + 4) << 8;
        if (!(s->option & PSA))
            s->prescaler_unknown = 0xFF;
        timer_flag_in_doubt(s);
    }
}

/* Returns why one of these bits of INTCON is unknown. */
static inline i64 source_of_flag(const Chip *s, i64 flags)
{
    if (flags & T0IF)
        return s->tmr0_unknown ? s->tmr0_unknown >> 8 : SOURCE_TMR0;
    return flags & INTF ? FLOATING_PIN + 5 : SOURCE_RB_CHANGE;
}

/* Notes a use if the beginning or the end of SLEEP depends on an unknown flag. */
static inline void doubt_sleep(Chip *s)
{
    i64 enabled = s->intcon >> 3 & 7;
    i64 flags = enabled & s->intcon_unknown;
    if (flags && !(enabled & s->intcon & ~s->intcon_unknown))
        use(s, USE_WAKE, flags, source_of_flag(s, flags));
}

/* Notes a use if an interrupt, or the waking of a sleeping chip, depends on an unknown flag. `counts` tells
   whether the internal clock increments TMR0. */
static inline void doubt(Chip *s, bool counts)
{
    if (s->sleeping)
        doubt_sleep(s);
    if (!(s->intcon & GIE) || s->sleeping)
        return;
    i64 enabled = s->intcon >> 3 & 7;
    if (enabled & s->intcon & ~s->intcon_unknown)
        return; /* the interrupt comes anyway */
    i64 flags = enabled & s->intcon_unknown;
    if (flags)
        use(s, USE_INTERRUPT, flags, source_of_flag(s, flags));
    else if (counts && enabled & T0IF && s->tmr0_unknown)
        use(s, USE_INTERRUPT, T0IF, s->tmr0_unknown >> 8);
}

#endif
