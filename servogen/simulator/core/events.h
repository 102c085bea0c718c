/* Events that instructions do not cause: stimuli, time-outs, interrupts, resets and sleep, and their times.

   Between two calls of `service_interrupts` the instruction loop runs freely, up to the cycle in `horizon`:
   the first cycle at whose start one of these events could be due. An instruction that changes these times
   ends the free run itself. */

#ifndef EVENTS_H
#define EVENTS_H

#include "registers.h"

/* Applies a reset other than power-up, in `cycle`: DS35007 section 6.4, tables 6-3 and 6-4. */
static void enter_reset(Chip *s, i64 *edges, i64 cycle)
{
    t0_advance(s, cycle);
    s->pc = s->here = s->pclath = 0;
    s->option = 0xFF; /* T0CS: TMR0 keeps its count */
    s->t0_at = s->t0_held = s->awake_at = cycle;
    s->t0_tick = NEVER;
    s->tris = ALL_PINS;
    s->sleeping = 0;
    s->sp = s->depth = 0;
    s->prescaler = s->prescaler_unknown = 0;
    s->pulsed = s->released = s->pulled_up = 0;
    wdt_start(s, cycle);
    reset_eecon1(s);
    emit(s, edges, cycle);
    settle(s, cycle);
    s->intcon &= RBIF;
    s->intcon_unknown &= RBIF;
    s->irq_at = NEVER;
    compare(s);
    if (s->tracked)
        flags_in_doubt(s, s->pins_unknown);
}

/* Resets the chip by MCLR, running or asleep (DS35007 table 6-3). */
static void mclr_reset(Chip *s, i64 *edges, i64 cycle)
{
    if (s->sleeping) {
        s->status = (s->status & C_DC_Z) | TO;
        s->resets_mclr_sleep += 1;
    } else {
        s->status &= C_DC_Z | TO | PD;
        s->resets_mclr += 1;
    }
    enter_reset(s, edges, cycle);
}

/* Returns the first cycle at which something not caused by an instruction happens, except interrupts. */
static inline i64 next_event(const Chip *s, const i64 *stim)
{
    i64 when = s->stim_next < s->stim_count ? stim[s->stim_next] >> PACK_CYCLE : s->stim_known;
    if (s->in_reset)
        return when;
    when = min(min(when, s->ee_done_at), s->t0_tick);
    return min(min(when, wdt_deadline(s)), s->wdt_earliest);
}

/* Applies one change from outside: of a pin, or of MCLR, which holds the chip in reset while low. */
static void stimulus(Chip *s, i64 *edges, i64 packed)
{
    i64 cycle = packed >> PACK_CYCLE, pin = packed >> PACK_PIN & 0xF, level = packed & PACK_LEVELS;
    if (pin < MCLR_PIN) {
        outside(s, cycle, pin, level);
    } else if (level == 0 && !s->in_reset) {
        s->in_reset = 1;
        mclr_reset(s, edges, cycle);
    } else if (level != 0 && s->in_reset) {
        s->in_reset = 0;
        wdt_start(s, cycle);
        s->cycle = cycle + FETCH;
    }
}

/* Continues after SLEEP once the oscillator runs again; then the flag that woke the chip is sampled.

   Whatever woke the chip, the watchdog restarts: DS35007 section 6.11.2. */
static void wake(Chip *s, i64 cycle)
{
    s->sleeping = 0;
    wdt_clear(s, cycle);
    s->cycle = s->awake_at = cycle + s->start_up;
    s->t0_at = max(s->t0_at, s->cycle);
    s->irq_at = NEVER;
    note_flags(s, s->cycle);
}

/* Handles a time-out, which wakes a sleeping chip (STATUS uuu0 0uuu) and resets a running one (DS35007 table
   6-3). */
static void watchdog(Chip *s, i64 *edges)
{
    i64 cycle = wdt_deadline(s);
    wdt_sync(s, cycle);
    if (s->sleeping) {
        s->status &= ~(TO | PD);
        s->wakes_wdt += 1;
        wake(s, cycle);
    } else {
        s->status = (s->status & C_DC_Z) | PD;
        s->resets_wdt += 1;
        enter_reset(s, edges, cycle);
        s->cycle = cycle + FETCH;
    }
}

/* Notes, once, that the watchdog of some chips would time out now. */
static void watchdog_in_doubt(Chip *s)
{
    s->here = s->pc;
    warn(s, WARN_WATCHDOG, 0);
    s->wdt_shortest = 0;
    s->wdt_earliest = NEVER;
}

/* Processes everything that is due by now in order of cycles, a stimulus before other events of its cycle,
   and then waking. */
static void deliver_events(Chip *s, i64 *edges, const i64 *stim)
{
    for (;;) {
        i64 when = next_event(s, stim);
        if (when > s->cycle) {
            if (!(s->sleeping && requested(s)))
                return;
            s->wakes_interrupt += 1;
            wake(s, s->cycle);
            continue;
        }
        bool supplied = s->stim_next < s->stim_count;
        if (!supplied && when >= s->stim_known)
            return; /* the host must supply the events from then on */
        if (supplied && stim[s->stim_next] >> PACK_CYCLE == when) {
            stimulus(s, edges, stim[s->stim_next]);
            s->stim_next += 1;
        } else if (s->ee_done_at == when) {
            write_done(s);
        } else if (s->t0_tick == when) {
            s->t0_tick = NEVER;
            t0_external(s, when);
        } else if (s->wdt_earliest == when) {
            watchdog_in_doubt(s);
        } else {
            watchdog(s, edges);
        }
    }
}

/* Enters an interrupt if one is due and sets `horizon`, after the events that are due have been processed. */
static void service_interrupts(Chip *s, i64 *edges, const i64 *stim)
{
    if (s->sleeping || s->in_reset) {
        s->horizon = next_event(s, stim);
        return;
    }
    i64 timer = s->intcon & (GIE | T0IE);
    if (timer == (GIE | T0IE))
        t0_sync(s, s->cycle);
    /* A request is served at the first instruction boundary after its cycle. */
    if (s->irq_at < s->cycle) {
        push(s, s->pc);
        s->pc = INTERRUPT_VECTOR;
        s->intcon &= ~GIE;
        s->cycle = s->irq_at + LATENCY;
        s->irq_at = NEVER;
        s->interrupts += 1;
        deliver_events(s, edges, stim);
    }
    s->horizon = next_event(s, stim);
    if (s->irq_at < NEVER)
        s->horizon = min(s->horizon, s->irq_at + 1);
    else if ((s->intcon & (GIE | T0IE | T0IF)) == (GIE | T0IE))
        s->horizon = min(s->horizon, t0_flag_at(s) + 1);
}

#endif
