/* The instruction loop, in four variants: plain, with observation, with tracking of unknown values, and
   noting the state at breakpoints.

   In: the state, the program, events from outside. Out: the state later, edges in a buffer, and the reason
   why it stopped. `observed` counts and traces every instruction; `tracked` tracks unknown values through
   each (unknown.h); with `visits` the loop does not return at a breakpoint, but copies the state to the trace
   and continues. Each is constant in a variant, so that the compiler removes what it does not need. */

#include <string.h>

#include "instructions.h"
#include "memo.h"

enum {
    UNTIL_PERIOD = 5, /* cycles of a turn of a wait for TMR0, */
    UNTIL_READ = 3,   /* and from its reading of TMR0 to its GOTO */
    TRACE_COLUMNS = 4,
};

/* What the loop works on beside the state. */
typedef struct {
    i64 *edges;
    const i64 *stim;  /* the changes from outside */
    const i64 *code;  /* the words, with the places that are executed in one step marked: regions.py */
    const i64 *plain; /* the words */
    const i64 *regions;
    Effect *memo;
    Record *recording; /* the regions that are being recorded, the innermost last */
    i64 depth;         /* how many these are */
    i64 base;          /* the row of `code` that is executed */
    i64 *counts, *trace;
} Work;

enum step { EXECUTE, AGAIN, NEW_HORIZON, LEAVE }; /* what the loop does after a marked word */

INLINED void save(Chip *s, const Cpu *p, bool tracked)
{
    s->pc = p->pc;
    s->w = p->w;
    s->status = p->status;
    s->cycle = p->cycle;
    if (tracked) {
        s->w_unknown = p->wu;
        s->status_unknown = p->su;
    }
}

/* Returns how often the wait for TMR0 to equal `value` turns, from its GOTO in `cycle` on, before `horizon`.

   Up to the last of these turns it has not read the value; after it the GOTO is still before `horizon`. */
static i64 turns_until(const Chip *s, i64 cycle, i64 value, i64 horizon)
{
    i64 first = cycle + UNTIL_PERIOD - UNTIL_READ;
    i64 ticks = (value - t0_read(s, first)) & 0xFF;
    i64 turns = (horizon - 1 - cycle) / UNTIL_PERIOD;
    if (ticks == 0)
        return 0;
    if (t0_runs(s)) {
        i64 past = s->prescaler & t0_mask(s);
        i64 counted = max(0, past + first - s->t0_at) >> t0_shift(s);
        i64 equal = s->t0_at + ((counted + ticks) << t0_shift(s)) - past;
        turns = min(turns, (equal - 1 - first) / UNTIL_PERIOD + 1);
    }
    return max(0, turns);
}

/* Turns the wait for TMR0 to equal a byte up to its last GOTO before that. */
INLINED void wait_for_timer(Chip *s, Cpu *p, i64 word, bool tracked)
{
    i64 slot = field(word), v = s->file[slot] & 0xFF, vu = s->file[slot] >> UNKNOWN_SHIFT;
    i64 ru = s->tmr0_unknown;
    /* Both known, or both moving with the same phase: only then is the time known at which they are equal. */
    if (vu != ru || (ru != 0 && ru != PHASED))
        return;
    i64 turns = turns_until(s, p->cycle, v, p->horizon);
    if (turns == 0)
        return;
    s->read_unwritten[slot] |= !!(s->file[slot] & NOT_WRITTEN);
    p->cycle += turns * UNTIL_PERIOD;
    p->start = p->cycle;
    i64 r = t0_read(s, p->cycle - UNTIL_READ);
    if (tracked) {
        if (ru | p->su) {
            i64 both = propagate(OP_XORWF, 0, v, vu, r, ru, p->su, v ^ r);
            p->su = both >> 16;
            ru = both & 0xFFFF;
        }
        p->wu = ru;
    }
    p->w = v ^ r;
    p->status &= ~Z;
}

/* Turns a GOTO back over words that do nothing; returns whether the horizon is reached. */
INLINED bool spin(Chip *s, Cpu *p, i64 word)
{
    i64 period = word >> F_SHIFT & 0xFF, clears = word >> (F_SHIFT + 8);
    i64 turns = (p->horizon - p->cycle) / period;
    if (clears && turns) {
        wdt_clear(s, p->cycle + (turns - 1) * period + 2 + clears);
        p->status |= TO | PD;
    }
    p->cycle += turns * period;
    p->start = p->cycle;
    return p->cycle >= p->horizon;
}

/* Recalls the effect of a region, or begins to record it. */
INLINED enum step enter_region(Chip *s, Cpu *p, Work *on, i64 word, bool tracked)
{
    i64 region = word >> F_SHIFT;
    if (s->pclath & PAGE_BITS) /* the memo's keys have no PCLATH: the region's GOTOs must stay in page 0 */
        return EXECUTE;
    i64 registers = pack_registers(s, on->regions, region);
    if (registers == UNKNOWN)
        return EXECUTE;
    i64 key = pack_processor(p->pc, p->w, p->status, p->wu, p->su);
    const Effect *effect = effect_of(on->memo, key, registers);
    if (effect->key == key && effect->registers == registers) {
        if (p->cycle + effect->cycles > p->horizon)
            return EXECUTE; /* an event is due inside the region, which is then executed word by word */
        p->cycle += effect->cycles;
        recall(s, effect, on->regions, region);
        i64 after = effect->after;
        p->pc = after >> 16 & PC_MASK;
        p->w = after >> 8 & 0xFF;
        p->status = after & 0xFF;
        if (tracked) {
            p->wu = after >> 29 & 0xFFFF;
            p->su = after >> 45;
        }
        return AGAIN;
    }
    if (on->depth < DEEPEST_RECORDING) {
        on->recording[on->depth++] = (Record){key, registers, p->cycle, region};
        on->base = (region + 1) * ROW;
    }
    return EXECUTE;
}

/* Ends the recording of the innermost region, which is left. Once an unknown bit has decided, the run goes on
   with the value that only some chips have, and notes no other such bit: nothing of it is true of all chips. */
INLINED void leave_region(Chip *s, const Cpu *p, Work *on)
{
    const Record *left = on->recording + --on->depth;
    i64 processor = pack_processor(p->pc, p->w, p->status, p->wu, p->su);
    if (!s->use_kind)
        remember(s, on->memo, left, on->regions, p->cycle, processor);
    on->base = on->depth ? (left[-1].region + 1) * ROW : 0;
}

/* Stops at a breakpoint, unless the run has `*resume`d there; returns LEAVE with the reason in `*why`. */
INLINED enum step at_breakpoint(
    Chip *s, const Cpu *p, const Work *on, i64 *resume, i64 *why, bool tracked, bool visits)
{
    if (p->cycle == *resume)
        return EXECUTE;
    save(s, p, tracked);
    settle_counters(s, p->cycle);
    *why = visits ? TRACE_FULL : AT_BREAKPOINT;
    if (!visits || s->trace_count == s->trace_room)
        return LEAVE;
    memcpy(on->trace + VISIT * s->trace_count, s, VISIT * sizeof(i64));
    s->trace_count += 1;
    *resume = p->cycle;
    return NEW_HORIZON;
}

/* Does what can be done in one step at a marked word. */
INLINED enum step at_mark(
    Chip *s, Cpu *p, Work *on, i64 word, i64 *resume, i64 *why, bool tracked, bool visits)
{
    switch (word & OP_MASK) {
    case OP_EXIT:
        leave_region(s, p, on);
        return AGAIN;
    case OP_BREAK:
        return at_breakpoint(s, p, on, resume, why, tracked, visits);
    case OP_LOOP:
        return enter_region(s, p, on, word, tracked);
    case OP_SPIN:
        return stays(s, on->plain, p->pc) && spin(s, p, word) ? NEW_HORIZON : EXECUTE;
    default: /* UNTIL */
        if (bank(p) == 0 && stays(s, on->plain, p->pc))
            wait_for_timer(s, p, word, tracked);
        return EXECUTE;
    }
}

/* Counts the instruction at `from`, and traces it; returns whether the trace is full. */
INLINED bool observe(Chip *s, const Cpu *p, const Work *on, i64 from)
{
    on->counts[2 * (from & ROW_MASK)] += 1;
    on->counts[2 * (from & ROW_MASK) + 1] += p->cycle - p->start;
    if (s->trace_room == 0)
        return false;
    i64 *row = on->trace + TRACE_COLUMNS * s->trace_count++;
    row[0] = p->start;
    row[1] = from;
    row[2] = p->w;
    row[3] = p->status;
    return s->trace_count == s->trace_room;
}

/* Processes what is due between two instructions; returns why the loop stops, or GOES_ON. */
INLINED i64 between(Chip *s, i64 end, const Work *on, bool observed)
{
    deliver_events(s, on->edges, on->stim);
    if (s->cycle == s->awake_at && !s->tracked) { /* at power-up pins may differ before any has changed */
        compare(s);
        note_flags(s, s->cycle);
    }
    if (s->cycle >= s->stim_known && s->stim_next == s->stim_count) {
        settle_counters(s, min(s->cycle, s->stim_known));
        return NEEDS_STIMULUS;
    }
    i64 why = GOES_ON;
    if (s->cycle >= end)
        why = AT_END;
    else if (s->edge_count >= s->edge_limit)
        why = EDGES_FULL;
    else if (observed && s->trace_room && s->trace_count >= s->trace_room)
        why = TRACE_FULL;
    if (why != GOES_ON) {
        settle_counters(s, s->cycle);
        return why;
    }
    service_interrupts(s, on->edges, on->stim);
    if (s->sleeping || s->in_reset)
        s->cycle = max(s->cycle, min(end, s->horizon));
    return GOES_ON;
}

INLINED i64 run(Chip *s, i64 end, Work on, i64 resume, bool observed, bool tracked, bool visits)
{
    Cpu p = {.pc = s->pc, .w = s->w, .status = s->status, .cycle = s->cycle};
    if (tracked) {
        p.wu = s->w_unknown;
        p.su = s->status_unknown;
    }
    for (;;) {
        save(s, &p, tracked);
        s->here = p.pc;
        i64 why = between(s, end, &on, observed);
        if (why != GOES_ON)
            return why;
        p.pc = s->pc;
        p.status = s->status;
        p.cycle = s->cycle;
        if (s->sleeping || s->in_reset)
            continue;
        p.horizon = min(s->horizon, end);
        on.base = on.depth = 0;
        while (p.cycle < p.horizon) {
            p.start = p.cycle;
            i64 from = p.pc;
            i64 word = on.code[on.base + (p.pc & ROW_MASK)];
            if ((word & OP_MASK) >= OP_EXIT) {
                enum step step = at_mark(s, &p, &on, word, &resume, &why, tracked, visits);
                if (step == AGAIN)
                    continue;
                if (step == NEW_HORIZON)
                    break;
                if (step == LEAVE)
                    return why;
                word = on.plain[p.pc & ROW_MASK];
            }
            p.pc = (p.pc + 1) & PC_MASK;
            p.cycle += 1;
            execute(s, on.edges, &p, on.plain, word, from, tracked);
            if (observed && observe(s, &p, &on, from))
                break;
        }
    }
}

#define VARIANT(name, observed, tracked, visits) \
    i64 name(Chip *s, i64 end, i64 *edges, const i64 *stim, const i64 *code, const i64 *plain, \
             const i64 *regions, Effect *memo, Record *recording, i64 resume, i64 *counts, i64 *trace) \
    { \
        Work on = {edges, stim, code, plain, regions, memo, recording, 0, 0, counts, trace}; \
        return run(s, end, on, resume, observed, tracked, visits); \
    }

const char sources[] = DIGEST;

VARIANT(plain, false, false, false)
VARIANT(observed, true, false, false)
VARIANT(tracked, false, true, false)
VARIANT(visits, false, false, true)
