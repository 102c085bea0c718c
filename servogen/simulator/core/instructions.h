/* The instructions: what each one computes, where the result goes, and which of its bits are unknown.

   Instructions and cycles: DS35007 section 7, table 7-2; STATUS as a destination: section 2.3.1; PCL as a
   destination: section 2.4; INDF and FSR: section 2.5. The word of an instruction is decoded: words.py. */

#ifndef INSTRUCTIONS_H
#define INSTRUCTIONS_H

#include "events.h"

enum {
    PC_MASK = 0x1FFF, /* 13 bits: section 2.4 */
    ROW = PROGRAM_WORDS,
    ROW_MASK = ROW - 1, /* 1024 words, mirrored above: section 2.1 */
    PAGE_BITS = 0x18,   /* of PCLATH, for CALL and GOTO: section 2.4 */
    LOW_7 = 0x7F,
    NO_SLOT = -1,
};

/* The processor: what the loop keeps in registers, and writes to the state where that is read. */
typedef struct {
    i64 pc, w, status;
    i64 wu, su; /* the unknown bits of W and STATUS */
    i64 cycle;
    i64 start;   /* of the instruction that is executed */
    i64 horizon; /* the cycle up to which the loop runs freely */
} Cpu;

/* The operand of an instruction on a file register: its place and what is read there, with its unknown bits.
   */
typedef struct {
    i64 address, slot, v, vu;
} Operand;

/* Writes the cycle and the address of the instruction to the state, for what notes uses and warnings. */
INLINED void locate(Chip *s, const Cpu *p)
{
    s->cycle = p->start;
    s->here = p->pc - 1;
}

INLINED i64 field(i64 word) { return word >> F_SHIFT & LOW_7; }
INLINED i64 literal(i64 word) { return word >> K_SHIFT & 0xFF; }
INLINED i64 bit_of(i64 word) { return word >> MASK_SHIFT & 0xFF; }
INLINED i64 bank(const Cpu *p) { return (p->status & RP0) << 2; } /* bit 5 becomes bit 7 of the address */

/* Returns the address that a GOTO or CALL leads to. */
INLINED i64 target(const Chip *s, i64 word)
{
    return (word >> K_SHIFT & 0x7FF) | (s->pclath & PAGE_BITS) << 8;
}

/* Returns whether the GOTO at `pc` stays in its own page and mirror image. */
INLINED bool stays(const Chip *s, const i64 *plain, i64 pc)
{
    return !(s->pclath & PAGE_BITS) && (plain[pc & ROW_MASK] >> K_SHIFT & 0x7FF) >> 10 == pc >> 10;
}

INLINED void set_z(Cpu *p, i64 r) { p->status = (p->status & ~Z) | (r ? 0 : Z); }

INLINED i64 add(Cpu *p, i64 v)
{
    i64 r = v + p->w;
    i64 half = (v & 15) + (p->w & 15);
    p->status = (p->status & ~(C | DC)) | r >> 8 | half >> 4 << 1;
    r &= 0xFF;
    set_z(p, r);
    return r;
}

INLINED i64 subtract(Cpu *p, i64 v)
{
    i64 r = (v - p->w) & 0xFF;
    p->status = (p->status & ~(C | DC)) | (v >= p->w ? C : 0) | ((v & 15) >= (p->w & 15) ? DC : 0);
    set_z(p, r);
    return r;
}

/* Returns the result of an instruction on a file register whose operand is `v`. */
INLINED i64 result_of(Cpu *p, i64 op, i64 word, i64 v)
{
    i64 r;
    switch (op) {
    case OP_BCF: return v & ~bit_of(word) & 0xFF;
    case OP_BSF: return v | bit_of(word);
    case OP_DECFSZ: return (v - 1) & 0xFF;
    case OP_INCFSZ: return (v + 1) & 0xFF;
    case OP_SWAPF: return (v >> 4 | v << 4) & 0xFF;
    case OP_ADDWF: return add(p, v);
    case OP_SUBWF: return subtract(p, v);
    case OP_RLF:
        r = (v << 1 | (p->status & C)) & 0xFF;
        p->status = (p->status & ~C) | v >> 7;
        return r;
    case OP_RRF:
        r = v >> 1 | (p->status & C) << 7;
        p->status = (p->status & ~C) | (v & C);
        return r;
    case OP_MOVF: r = v; break;
    case OP_ANDWF: r = v & p->w; break;
    case OP_IORWF: r = v | p->w; break;
    case OP_XORWF: r = v ^ p->w; break;
    case OP_COMF: r = v ^ 0xFF; break;
    case OP_DECF: r = (v - 1) & 0xFF; break;
    default: r = (v + 1) & 0xFF; /* INCF */
    }
    set_z(p, r);
    return r;
}

/* Finds the place of the operand: the address, with the bank, and its slot if it is in the RAM. */
INLINED Operand place_of(Chip *s, const Cpu *p, i64 word, bool tracked)
{
    i64 address = field(word);
    if (word >> DIRECT_BIT & 1)
        return (Operand){address, address, 0, 0};
    if (address) {
        address |= bank(p);
    } else {
        address = s->fsr;
        if (tracked && s->fsr_unknown) {
            locate(s, p);
            use(s, USE_POINTER, 0, s->fsr_unknown >> 8);
        }
    }
    i64 low = address & LOW_7;
    return (Operand){address, low >= RAM_FIRST && low <= RAM_LAST ? low : NO_SLOT, 0, 0};
}

/* Reads the operand. */
INLINED void read_operand(Chip *s, const Cpu *p, i64 word, Operand *o, bool tracked)
{
    if (o->slot >= 0) {
        i64 v = s->file[o->slot];
        if (v > 0xFF) {
            if (v & NOT_WRITTEN)
                s->read_unwritten[o->slot] = 1;
            o->vu = v >> UNKNOWN_SHIFT;
        }
        o->v = v & 0xFF;
    } else if ((o->address & LOW_7) == STATUS_ADDRESS) {
        o->v = p->status;
        o->vu = p->su;
    } else if ((o->address & LOW_7) == PCL_ADDRESS) {
        o->v = p->pc & 0xFF;
    } else {
        locate(s, p);
        i64 read = read_register(s, o->address, p->start, bit_of(word) ? bit_of(word) : 0xFF);
        o->v = read & 0xFF;
        o->vu = read >> 8;
    }
    if (!tracked)
        o->vu = 0;
}

/* Writes STATUS: the flags that the instruction sets itself, TO and PD are not written. */
INLINED void write_status(Chip *s, Cpu *p, i64 word, i64 r, i64 ru, bool tracked)
{
    bool flags = word >> FLAGS_BIT & 1;
    if (tracked) {
        if (ru & RP0) {
            locate(s, p);
            use(s, USE_BANK, 0, ru >> 8);
        }
        if (flags) {
            ru = without(ru, C_DC_Z) | (p->su & C_DC_Z);
            if (ru & 0xFF && !(ru & 0xFF00))
                ru |= p->su & 0xFF00;
        }
        p->su = written_status(p->su, ru);
    }
    i64 kept = TO | PD | (flags ? C_DC_Z : 0);
    p->status = (r & ~kept) | (p->status & kept);
}

/* Writes the result to the file register; returns whether the write was one of PCL, which is a jump. */
INLINED bool write_file(Chip *s, i64 *edges, Cpu *p, i64 word, const Operand *o, i64 r, i64 ru, bool tracked)
{
    if (o->slot >= 0) {
        s->file[o->slot] = tracked ? r | ru << UNKNOWN_SHIFT : r;
    } else if ((o->address & LOW_7) == STATUS_ADDRESS) {
        write_status(s, p, word, r, ru, tracked);
    } else if ((o->address & LOW_7) == PCL_ADDRESS) {
        if (tracked && ru) {
            locate(s, p);
            use(s, USE_JUMP, 0, ru >> 8);
        }
        p->pc = s->pclath << 8 | r;
        p->cycle += 1;
        return true;
    } else {
        locate(s, p);
        /* The write may have moved the time of an event: the loop returns for a new horizon. */
        if (write_register(s, edges, o->address, p->start, r, ru))
            p->horizon = 0;
    }
    return false;
}

/* Turns the wait that a bit test which does not skip begins: the GOTO after it leads back here, and nothing
   changes until an event. */
INLINED void wait_for_bit(Chip *s, Cpu *p, i64 word, const Operand *o)
{
    bool flags = (o->address & LOW_7) == INTCON_ADDRESS;
    i64 limit = flags ? min(p->horizon, t0_news_at(s)) : p->horizon;
    i64 period = word >> (WAITS_BIT + 1) & 0xFF, clears = word >> (WAITS_BIT + 9);
    i64 turns = max(0, limit - 1 - p->start) / period;
    if (clears && turns) {
        wdt_clear(s, p->start + (turns - 1) * period + 3 + clears);
        p->status |= TO | PD;
    }
    p->cycle += turns * period;
}

INLINED void skip(Cpu *p)
{
    p->pc = (p->pc + 1) & PC_MASK;
    p->cycle += 1;
}

/* Executes BTFSC or BTFSS. */
INLINED void test_bit(Chip *s, Cpu *p, const i64 *plain, i64 op, i64 word, const Operand *o, bool tracked)
{
    bool skips = !!(o->v & bit_of(word)) == (op == OP_BTFSS);
    if (!skips && word >> WAITS_BIT & 1 && stays(s, plain, p->pc))
        wait_for_bit(s, p, word, o);
    if (tracked && o->vu & bit_of(word)) {
        locate(s, p);
        use(s, USE_SKIP, 0, o->vu >> 8);
    }
    if (skips)
        skip(p);
}

/* Executes an instruction on a file register; `op` is its number, a constant. */
INLINED void on_file(Chip *s, i64 *edges, Cpu *p, const i64 *plain, i64 op, i64 word, bool tracked)
{
    i64 r, ru = 0;
    Operand o = place_of(s, p, word, tracked);
    if (op == OP_MOVWF) {
        r = p->w;
        ru = p->wu;
    } else if (op == OP_CLRF) {
        r = 0;
        p->status |= Z;
        if (tracked)
            p->su = without(p->su, Z);
    } else {
        read_operand(s, p, word, &o, tracked);
        if (op == OP_BTFSC || op == OP_BTFSS) {
            test_bit(s, p, plain, op, word, &o, tracked);
            return;
        }
        i64 w = p->w;
        r = result_of(p, op, word, o.v);
        if (tracked && o.vu | p->wu | p->su) {
            i64 both = propagate(op, bit_of(word), o.v, o.vu, w, p->wu, p->su, r);
            p->su = both >> 16;
            ru = both & 0xFFFF;
        }
    }
    bool skips = (op == OP_DECFSZ || op == OP_INCFSZ) && r == 0;
    if (tracked && (op == OP_DECFSZ || op == OP_INCFSZ) && ru && (r & ~ru & 0xFF) == 0) {
        locate(s, p);
        use(s, USE_SKIP, 0, ru >> 8);
    }
    if (word >> D_BIT & 1) {
        if (write_file(s, edges, p, word, &o, r, ru, tracked))
            return; /* the word that a skip would discard is already discarded */
    } else {
        p->w = r;
        if (tracked)
            p->wu = ru;
    }
    if (skips)
        skip(p);
}

/* Executes an instruction whose result goes to W, with a literal `v`. */
INLINED void on_literal(Cpu *p, i64 op, i64 v, bool tracked)
{
    i64 r, w = p->w;
    switch (op) {
    case OP_ADDLW: r = add(p, v); break;
    case OP_SUBLW: r = subtract(p, v); break;
    case OP_ANDLW: r = w & v; set_z(p, r); break;
    case OP_IORLW: r = w | v; set_z(p, r); break;
    default: r = w ^ v; set_z(p, r); /* XORLW */
    }
    if (tracked && p->wu | p->su) {
        i64 both = propagate(op, 0, v, 0, w, p->wu, p->su, r);
        p->su = both >> 16;
        p->wu = both & 0xFFFF;
    }
    p->w = r;
}

INLINED void move_to_w(Cpu *p, i64 v)
{
    p->w = v;
    p->wu = 0;
}

/* Executes RETFIE after the address is popped. */
INLINED void enable_interrupts(Chip *s, Cpu *p, bool tracked)
{
    t0_sync(s, p->start);
    s->intcon |= GIE;
    note_flags(s, p->start + 1);
    if (tracked)
        doubt(s, t0_runs(s));
    p->horizon = 0;
}

INLINED void go_to_sleep(Chip *s, Cpu *p, bool tracked)
{
    t0_sync(s, p->start);
    if (tracked) {
        locate(s, p);
        doubt_sleep(s);
    }
    if (requested(s))
        return; /* a NOP: section 6.11.3 */
    wdt_clear(s, p->cycle);
    p->status = (p->status & ~PD) | TO;
    if (tracked)
        p->su = without(p->su, TO | PD);
    t0_advance(s, p->cycle);
    s->sleeping = 1;
    p->horizon = 0;
}

/* Executes an instruction, whose address is `from`. */
INLINED void execute(Chip *s, i64 *edges, Cpu *p, const i64 *plain, i64 word, i64 from, bool tracked)
{
#define ON_FILE(op) case op: on_file(s, edges, p, plain, op, word, tracked); break;
    i64 op = word & OP_MASK;
    switch (op) {
    ON_FILE(OP_ADDWF) ON_FILE(OP_ANDWF) ON_FILE(OP_CLRF) ON_FILE(OP_COMF) ON_FILE(OP_DECF) ON_FILE(OP_DECFSZ)
    ON_FILE(OP_INCF) ON_FILE(OP_INCFSZ) ON_FILE(OP_IORWF) ON_FILE(OP_MOVF) ON_FILE(OP_MOVWF) ON_FILE(OP_RLF)
    ON_FILE(OP_RRF) ON_FILE(OP_SUBWF) ON_FILE(OP_SWAPF) ON_FILE(OP_XORWF) ON_FILE(OP_BCF) ON_FILE(OP_BSF)
    ON_FILE(OP_BTFSC) ON_FILE(OP_BTFSS)
#undef ON_FILE
    case OP_GOTO:
        p->pc = target(s, word);
        p->cycle += 1;
        break;
    case OP_CALL:
        locate(s, p);
        push(s, p->pc);
        p->pc = target(s, word);
        p->cycle += 1;
        break;
    case OP_RETURN: case OP_RETLW: case OP_RETFIE:
        locate(s, p);
        p->pc = pop(s);
        p->cycle += 1;
        if (op == OP_RETLW)
            move_to_w(p, literal(word));
        else if (op == OP_RETFIE)
            enable_interrupts(s, p, tracked);
        break;
    case OP_MOVLW:
        move_to_w(p, literal(word));
        break;
    case OP_CLRW:
        move_to_w(p, 0);
        p->status |= Z;
        if (tracked)
            p->su = without(p->su, Z);
        break;
    case OP_NOP:
        break;
    case OP_CLRWDT:
        wdt_clear(s, p->cycle); /* the deadline only moves away, so the horizon holds */
        p->status |= TO | PD;
        if (tracked)
            p->su = without(p->su, TO | PD);
        break;
    case OP_SLEEP:
        go_to_sleep(s, p, tracked);
        break;
    case OP_OPTION:
        locate(s, p);
        write_option(s, p->start, p->w, p->wu);
        p->horizon = 0;
        break;
    case OP_TRIS:
        locate(s, p);
        tris_write(s, edges, p->start, field(word) == PORTA_ADDRESS ? PORT_A : PORT_B, p->w, p->wu);
        p->horizon = 0;
        break;
    case OP_UNDEFINED:
        locate(s, p);
        warn(s, WARN_UNDEFINED, from & ROW_MASK);
        break;
    case OP_ERASED:
        locate(s, p);
        warn(s, WARN_ERASED, from & ROW_MASK);
        on_literal(p, OP_ADDLW, 0xFF, tracked);
        break;
    default:
        on_literal(p, op, literal(word), tracked);
    }
}

#endif
