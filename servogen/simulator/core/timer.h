/* TMR0, its prescaler and the watchdog that shares it.

   DS35007 section 5 and 6.10; timing DS30430 figures 6-2 to 6-4. Nothing counts cycle by cycle: `tmr0` and
   `prescaler` are what the counters held at the anchor `t0_at`, and with the internal clock the rest follows
   from the cycle. Before the anchor (the two cycles after a write) the timer stands still.

     write in cycle c      c+1   c+2   c+3   c+4     an instruction reads NT0 in three cycles, then NT0 + 1:
     TMR0 read     NT0 ->  NT0   NT0   NT0   NT0+1   the anchor is c + 3 (DS30430 figures 6-2 and 6-3)

   T0IF is set by the clock that takes TMR0 from FFh to 00h, three oscillator periods before the register
   changes (DS30430 figure 6-4, note 4): it is read as set one cycle before TMR0 is first read as 00h.

   The data sheets do not specify when TMR0 begins to count with a clock that OPTION_REG has just selected: it
   first stands still for `t0_phase` cycles. */

#ifndef TIMER_H
#define TIMER_H

#include "interrupts.h"

enum {
    INHIBITED = 3,  /* cycles from a write of TMR0 to the cycle that counts as its anchor */
    FLAG_AHEAD = 1, /* cycles by which T0IF is seen before TMR0 is read as 00h */
};

/* Returns log2 of the prescaler's division of the timer's clock (DS35007 section 5.2). */
static inline i64 t0_shift(const Chip *s) { return s->option & PSA ? 0 : (s->option & PS) + 1; }

/* Returns the bits of the prescaler that count. */
static inline i64 t0_mask(const Chip *s) { return ((i64)1 << t0_shift(s)) - 1; }

/* Returns whether the instruction clock increments the timer; there is no such clock in SLEEP. */
static inline bool t0_runs(const Chip *s) { return !(s->option & T0CS) && !s->sleeping; }

/* Returns what an instruction in `cycle` reads from TMR0. */
static inline i64 t0_read(const Chip *s, i64 cycle)
{
    if (!t0_runs(s) || cycle <= s->t0_at)
        return s->tmr0;
    i64 ticks = (s->prescaler & t0_mask(s)) + cycle - s->t0_at;
    return (s->tmr0 + (ticks >> t0_shift(s))) & 0xFF;
}

/* Returns the cycle in which T0IF is next seen set by the internal clock, or NEVER. */
static inline i64 t0_flag_at(const Chip *s)
{
    if (!t0_runs(s))
        return NEVER;
    i64 shift = t0_shift(s);
    i64 ticks = ((256 - s->tmr0) << shift) - (s->prescaler & t0_mask(s));
    i64 due = s->t0_at + ticks - FLAG_AHEAD;
    if (due <= s->t0_flagged) /* this overflow's flag was seen ahead of it, and has been set */
        due += (i64)256 << shift;
    return due;
}

/* Returns the cycle in which T0IF next becomes set or, if TMR0's value is unknown, could become set; or
   NEVER.

   Once a use of an unknown value has been noted, possible settings no longer matter. */
static inline i64 t0_news_at(const Chip *s)
{
    if (s->tmr0_unknown && s->use_kind == 0 && t0_runs(s)) {
        if (s->prescaler_unknown & t0_mask(s))
            return s->t0_at;
        return s->t0_at + ((i64)1 << t0_shift(s)) - (s->prescaler & t0_mask(s)) - FLAG_AHEAD;
    }
    return t0_flag_at(s);
}

/* Moves the anchor to `cycle`, without regard to T0IF. */
static inline void t0_advance(Chip *s, i64 cycle)
{
    if (!t0_runs(s) || cycle <= s->t0_at)
        return;
    i64 value = t0_read(s, cycle);
    if (!(s->option & PSA))
        s->prescaler = (s->prescaler + cycle - s->t0_at) & 0xFF;
    s->tmr0 = value;
    s->t0_at = cycle;
}

/* Moves the anchor to `cycle`, and sets T0IF if it was due by then. */
static void t0_sync(Chip *s, i64 cycle)
{
    if (s->tmr0_unknown && s->use_kind == 0 && t0_news_at(s) <= cycle)
        timer_flag_in_doubt(s);
    i64 due = t0_flag_at(s);
    if (due <= cycle) {
        /* The latest overflow up to now: `t0_flag_at` must not report it again. */
        s->t0_flagged = cycle - (cycle - due) % ((i64)256 << t0_shift(s));
        s->intcon |= T0IF;
        note_flags(s, due);
    }
    t0_advance(s, cycle);
}

/* Writes TMR0 by an instruction in `cycle`; "increment is inhibited" (DS35007 section 5). */
static void t0_write(Chip *s, i64 cycle, i64 value, i64 unknown)
{
    t0_sync(s, cycle);
    s->tmr0 = value;
    /* From here on the byte counts, and a carry out of an unknown bit reaches all bits above it. */
    s->tmr0_unknown = upward(unknown & 0xFF) | (unknown & ~0xFF);
    /* An anchor in the future: until then the timer reads the written value and counts nothing. */
    s->t0_at = s->t0_held = cycle + INHIBITED;
    if (!(s->option & PSA))
        s->prescaler = s->prescaler_unknown = 0;
}

/* Counts an edge of T0CKI in `cycle`; an edge while the timer stands still is lost. */
static void t0_external(Chip *s, i64 cycle)
{
    if (cycle <= s->t0_held)
        return;
    if (t0_shift(s)) {
        s->prescaler = (s->prescaler + 1) & 0xFF;
        if (s->prescaler & ~s->prescaler_unknown & t0_mask(s))
            return;
    }
    s->tmr0 = (s->tmr0 + 1) & 0xFF;
    if (s->tmr0_unknown)
        timer_flag_in_doubt(s);
    if (s->tmr0 == 0) {
        s->intcon |= T0IF;
        note_flags(s, cycle);
    }
}

/* Returns the watchdog's periods up to a time-out, for a prescaler that counts them from `prescaler` on. */
static inline i64 wdt_periods(const Chip *s)
{
    i64 division = (i64)1 << (s->option & PS);
    return s->option & PSA ? division - (s->prescaler & (division - 1)) : 1;
}

/* Returns the cycle of the next watchdog time-out, or NEVER (DS35007 section 6.10). */
static inline i64 wdt_deadline(const Chip *s)
{
    return s->wdt_period ? s->wdt_at + wdt_periods(s) * s->wdt_period : NEVER;
}

/* Accounts for the watchdog's periods up to `cycle`, which the prescaler counts if it is assigned to the
   watchdog. */
static inline void wdt_sync(Chip *s, i64 cycle)
{
    if (s->wdt_period == 0)
        return;
    i64 past = cycle - s->wdt_at; /* negative before the chip has started; the quotient is rounded down */
    i64 periods = past / s->wdt_period - (past % s->wdt_period < 0);
    s->wdt_at += periods * s->wdt_period;
    if (s->option & PSA)
        s->prescaler = (s->prescaler + periods) & 0xFF;
}

/* Updates the state to what the counters hold in `cycle`, so that the host can read them. */
static void settle_counters(Chip *s, i64 cycle)
{
    t0_sync(s, cycle);
    /* In reset the watchdog does not count; a time-out that is due in this very cycle is still to come. */
    if (!s->in_reset && cycle < wdt_deadline(s))
        wdt_sync(s, cycle);
}

/* Sets the cycle in which the watchdog of the chip with the shortest period would time out. */
static inline void foresee(Chip *s)
{
    if (s->wdt_shortest)
        s->wdt_earliest = s->wdt_cleared + wdt_periods(s) * s->wdt_shortest;
}

/* Begins the watchdog's period at `cycle`; the prescaler is unchanged. */
static inline void wdt_start(Chip *s, i64 cycle)
{
    s->wdt_at = s->wdt_cleared = cycle;
    foresee(s);
}

/* Restarts the watchdog at `cycle`, for CLRWDT or SLEEP; its prescaler becomes 0 if assigned to it. */
static inline void wdt_clear(Chip *s, i64 cycle)
{
    if (s->option & PSA)
        s->prescaler = s->prescaler_unknown = 0;
    wdt_start(s, cycle);
}

/* Applies a new `value` of OPTION_REG from `cycle`; the prescaler keeps its count when it is reassigned.

   The count of a prescaler assigned to the watchdog is unknown once the shortest period is over. */
static void option_write(Chip *s, i64 cycle, i64 value)
{
    s->option_writes += 1;
    /* Everything is counted by the old clock up to `cycle`, then the new one takes over. */
    t0_sync(s, cycle - 1);
    t0_advance(s, cycle);
    wdt_sync(s, cycle - 1);
    i64 changed = s->option ^ value;
    s->option = value;
    if (s->wdt_shortest && changed & (PSA | (value & PSA ? PS : 0))) {
        /* Before the shortest period is over no chip's watchdog has advanced the prescaler. */
        if (cycle - s->wdt_cleared < s->wdt_shortest)
            foresee(s);
        else
            s->wdt_earliest = cycle;
    }
    /* The timer's prescaler divides by twice as much as the watchdog's (DS35007 register 2-2). */
    i64 division = (i64)(value & PSA ? 1 : 2) << (value & PS);
    if (s->prescaler_unknown & (division - 1)) {
        if (!(value & PSA))
            s->tmr0_unknown = 0xFF | SOURCE_PRESCALER << 8;
        else if (s->wdt_shortest)
            s->wdt_earliest = cycle;
    }
    s->t0_at = max(s->t0_at, cycle);
    if (!(value & T0CS)) {
        s->t0_tick = NEVER;
        if (changed & (T0CS | PSA | (value & PSA ? 0 : PS)))
            s->t0_at = max(s->t0_at, cycle + s->t0_phase);
    }
}

#endif
