"""Events that instructions do not cause: stimuli, time-outs, interrupts, resets and sleep, and their times.
Compiled.

Between two calls of `service_interrupts` the instruction loop runs freely, up to the cycle in `HORIZON`: the
first cycle at whose start one of these events could be due. An instruction that changes these times ends the
free run itself.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.eeprom import write_done
from servogen.simulator.interrupts import GIE, LATENCY, T0IE, T0IF, note_flags, requested
from servogen.simulator.layout import (
    AWAKE_AT,
    CYCLE,
    EE_DONE_AT,
    HERE,
    HORIZON,
    IN_RESET,
    INTCON,
    INTERRUPTS,
    IRQ_AT,
    MCLR_PIN,
    NEVER,
    PACK_CYCLE,
    PACK_LEVELS,
    PACK_PIN,
    PC,
    SLEEPING,
    START_UP,
    STATUS,
    STIM_COUNT,
    STIM_KNOWN,
    STIM_NEXT,
    T0_AT,
    T0_TICK,
    WAKES_INTERRUPT,
    WAKES_WDT,
    WARN_WATCHDOG,
    WDT_EARLIEST,
    WDT_SHORTEST,
)
from servogen.simulator.ports import outside
from servogen.simulator.resets import FETCH, PD, TO, mclr_reset, watchdog_reset
from servogen.simulator.stack import push
from servogen.simulator.timer import (
    t0_external,
    t0_flag_at,
    t0_sync,
    wdt_clear,
    wdt_deadline,
    wdt_start,
    wdt_sync,
)
from servogen.simulator.warn import warn

INTERRUPT_VECTOR = 0x004


@compiled
def next_event(s: Vector, stim: Vector) -> int:
    """Return the first cycle at which something not caused by an instruction happens, except interrupts."""
    when = s[STIM_KNOWN]
    if s[STIM_NEXT] < s[STIM_COUNT]:
        when = stim[s[STIM_NEXT]] >> PACK_CYCLE
    if s[IN_RESET]:
        return when
    when = min(when, s[EE_DONE_AT], s[T0_TICK])
    return min(when, wdt_deadline(s), s[WDT_EARLIEST])


@compiled
def stimulus(s: Vector, edges: Vector, packed: int) -> None:
    """Apply one change from outside: of a pin, or of MCLR, which holds the chip in reset while low."""
    cycle = packed >> PACK_CYCLE
    pin = packed >> PACK_PIN & 0xF
    level = packed & PACK_LEVELS
    if pin < MCLR_PIN:
        outside(s, cycle, pin, level)
    elif level == 0 and not s[IN_RESET]:
        s[IN_RESET] = 1
        mclr_reset(s, edges, cycle)
    elif level != 0 and s[IN_RESET]:
        s[IN_RESET] = 0
        wdt_start(s, cycle)
        s[CYCLE] = cycle + FETCH


@compiled
def wake(s: Vector, cycle: int) -> None:
    """Continue after SLEEP once the oscillator runs again; then the flag that woke the chip is sampled.

    Whatever woke the chip, the watchdog restarts: DS35007 section 6.11.2.
    """
    s[SLEEPING] = 0
    wdt_clear(s, cycle)
    s[CYCLE] = cycle + s[START_UP]
    s[T0_AT] = max(s[T0_AT], s[CYCLE])
    s[AWAKE_AT] = s[CYCLE]
    s[IRQ_AT] = NEVER
    note_flags(s, s[CYCLE])


@compiled
def watchdog(s: Vector, edges: Vector) -> None:
    """Handle a time-out, which wakes a sleeping chip (STATUS uuu0 0uuu) and resets a running one (DS35007
    table 6-3).
    """
    cycle = wdt_deadline(s)
    wdt_sync(s, cycle)
    if s[SLEEPING]:
        s[STATUS] &= ~(TO | PD)
        s[WAKES_WDT] += 1
        wake(s, cycle)
    else:
        watchdog_reset(s, edges, cycle)
        s[CYCLE] = cycle + FETCH


@compiled
def watchdog_in_doubt(s: Vector) -> None:
    """Note, once, that the watchdog of some chips would time out now."""
    s[HERE] = s[PC]
    warn(s, WARN_WATCHDOG, 0)
    s[WDT_SHORTEST] = 0
    s[WDT_EARLIEST] = NEVER


@compiled
def deliver_events(s: Vector, edges: Vector, stim: Vector) -> None:
    """Process everything that is due by now in order of cycles, a stimulus before other events of its cycle,
    and then waking.
    """
    while True:
        now = s[CYCLE]
        when = next_event(s, stim)
        if when > now:
            if not (s[SLEEPING] and requested(s)):
                return
            s[WAKES_INTERRUPT] += 1
            wake(s, now)
            continue
        if s[STIM_NEXT] == s[STIM_COUNT] and when >= s[STIM_KNOWN]:
            return  # the host must supply the events from then on
        if s[STIM_NEXT] < s[STIM_COUNT] and stim[s[STIM_NEXT]] >> PACK_CYCLE == when:
            stimulus(s, edges, stim[s[STIM_NEXT]])
            s[STIM_NEXT] += 1
        elif s[EE_DONE_AT] == when:
            write_done(s)
        elif s[T0_TICK] == when:
            s[T0_TICK] = NEVER
            t0_external(s, when)
        elif s[WDT_EARLIEST] == when:
            watchdog_in_doubt(s)
        else:
            watchdog(s, edges)


@compiled
def service_interrupts(s: Vector, edges: Vector, stim: Vector) -> None:
    """Enter an interrupt if one is due and set `HORIZON`, after the events that are due have been
    processed.
    """
    now = s[CYCLE]
    if s[SLEEPING] or s[IN_RESET]:
        s[HORIZON] = next_event(s, stim)
        return
    if s[INTCON] & (GIE | T0IE) == GIE | T0IE:
        t0_sync(s, now)
    # A request is served at the first instruction boundary after its cycle.
    if s[IRQ_AT] < now:
        push(s, s[PC])
        s[PC] = INTERRUPT_VECTOR
        s[INTCON] &= ~GIE
        s[CYCLE] = s[IRQ_AT] + LATENCY
        s[IRQ_AT] = NEVER
        s[INTERRUPTS] += 1
        deliver_events(s, edges, stim)
    horizon = next_event(s, stim)
    if s[IRQ_AT] < NEVER:
        horizon = min(horizon, s[IRQ_AT] + 1)
    elif s[INTCON] & (GIE | T0IE | T0IF) == GIE | T0IE:
        horizon = min(horizon, t0_flag_at(s) + 1)
    s[HORIZON] = horizon
