/* Interrupt flags, enables and the moment at which they are sampled.

   DS35007 section 6.8 (INTCON, section 2.3.3), timing DS30430 figures 6-4 and 8-17: the flags are sampled in
   Q1 of every cycle. Sampled true in cycle n, the instruction of cycle n still executes, and the one at 0004h
   executes in cycle n + 3, whatever the length of the former. `irq_at` is that n, or NEVER. */

#ifndef INTERRUPTS_H
#define INTERRUPTS_H

#include "unknown.h"

enum { LATENCY = 3 };

/* Returns whether an enabled flag is set, regardless of GIE; this wakes the chip. */
static inline bool requested(const Chip *s)
{
    return (s->intcon >> 3 & s->intcon & 7) || (s->intcon & EEIE && s->eecon1 & EEIF);
}

/* Updates the sampling after flags or enables have changed in `cycle`; what was sampled before remains valid.
   */
static void note_flags(Chip *s, i64 cycle)
{
    if (s->intcon_unknown)
        doubt(s, false);
    cycle = max(cycle, s->awake_at); /* a chip that is starting up samples nothing */
    if (s->intcon & GIE && requested(s))
        s->irq_at = min(s->irq_at, cycle);
    else if (s->irq_at >= cycle)
        s->irq_at = NEVER;
}

#endif
