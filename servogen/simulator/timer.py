"""TMR0, its prescaler and the watchdog that shares it. Compiled.

DS35007 section 5 and 6.10; timing DS30430 figures 6-2 to 6-4. Nothing counts cycle by cycle: `TMR0` and
`PRESCALER` are what the counters held at the anchor `T0_AT`, and with the internal clock the rest follows
from the cycle. Before the anchor (the two cycles after a write) the timer stands still.

    write in cycle c      c+1   c+2   c+3   c+4     an instruction reads NT0 in three cycles and then NT0 + 1,
    TMR0 read     NT0 ->  NT0   NT0   NT0   NT0+1   so the anchor is c + 3 (DS30430 figures 6-2 and 6-3)

T0IF is set by the clock that takes TMR0 from FFh to 00h, three oscillator periods before the register changes
(DS30430 figure 6-4, note 4): it is read as set one cycle before TMR0 is first read as 00h.

The data sheets do not specify when TMR0 begins to count with a clock that OPTION_REG has just selected: it
first stands still for `T0_PHASE` cycles.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.interrupts import T0IF, note_flags
from servogen.simulator.layout import (
    INTCON,
    NEVER,
    OPTION,
    OPTION_WRITES,
    PRESCALER,
    PRESCALER_UNKNOWN,
    PS,
    PSA,
    SLEEPING,
    SOURCE_PRESCALER,
    T0_AT,
    T0_FLAGGED,
    T0_HELD,
    T0_PHASE,
    T0_TICK,
    T0CS,
    TMR0,
    TMR0_UNKNOWN,
    USE_KIND,
    WDT_AT,
    WDT_CLEARED,
    WDT_EARLIEST,
    WDT_PERIOD,
    WDT_SHORTEST,
)
from servogen.simulator.unknown import timer_flag_in_doubt, upward

INHIBITED = 3
"""Cycles from a write of TMR0 to the cycle that counts as its anchor."""
FLAG_AHEAD = 1
"""Cycles by which T0IF is seen before TMR0 is read as 00h."""


@compiled
def t0_shift(s: Vector) -> int:
    """Return log2 of the prescaler's division of the timer's clock (DS35007 section 5.2)."""
    option = s[OPTION]
    return 0 if option & PSA else (option & PS) + 1


@compiled
def t0_runs(s: Vector) -> bool:
    """Return whether the instruction clock increments the timer; there is no such clock in SLEEP."""
    return (s[OPTION] & T0CS) == 0 and s[SLEEPING] == 0


@compiled
def t0_read(s: Vector, cycle: int) -> int:
    """Return what an instruction in `cycle` reads from TMR0."""
    if not t0_runs(s) or cycle <= s[T0_AT]:
        return s[TMR0]
    shift = t0_shift(s)
    ticks = (s[PRESCALER] & ((1 << shift) - 1)) + cycle - s[T0_AT]
    return (s[TMR0] + (ticks >> shift)) & 0xFF


@compiled
def t0_flag_at(s: Vector) -> int:
    """Return the cycle in which T0IF is next seen set by the internal clock, or NEVER."""
    if not t0_runs(s):
        return NEVER
    shift = t0_shift(s)
    ticks = ((256 - s[TMR0]) << shift) - (s[PRESCALER] & ((1 << shift) - 1))
    due = s[T0_AT] + ticks - FLAG_AHEAD
    if due <= s[T0_FLAGGED]:  # this overflow's flag was seen ahead of it, and has been set
        due += 256 << shift
    return due


@compiled
def t0_news_at(s: Vector) -> int:
    """Return the cycle in which T0IF next becomes set or, if TMR0's value is unknown, could become set; or
    NEVER.

    Once a use of an unknown value has been noted, possible settings no longer matter.
    """
    if s[TMR0_UNKNOWN] and s[USE_KIND] == 0 and t0_runs(s):
        shift = t0_shift(s)
        if s[PRESCALER_UNKNOWN] & ((1 << shift) - 1):
            return s[T0_AT]
        return s[T0_AT] + (1 << shift) - (s[PRESCALER] & ((1 << shift) - 1)) - FLAG_AHEAD
    return t0_flag_at(s)


@compiled
def t0_sync(s: Vector, cycle: int) -> None:
    """Move the anchor to `cycle`, and set T0IF if it was due by then."""
    if s[TMR0_UNKNOWN] and s[USE_KIND] == 0 and t0_news_at(s) <= cycle:
        timer_flag_in_doubt(s)
    due = t0_flag_at(s)
    if due <= cycle:
        # The latest overflow up to now: `t0_flag_at` must not report it again.
        s[T0_FLAGGED] = cycle - (cycle - due) % (256 << t0_shift(s))
        s[INTCON] |= T0IF
        note_flags(s, due)
    t0_advance(s, cycle)


@compiled
def t0_advance(s: Vector, cycle: int) -> None:
    """Move the anchor to `cycle`, without regard to T0IF."""
    if not t0_runs(s) or cycle <= s[T0_AT]:
        return
    value = t0_read(s, cycle)
    if not s[OPTION] & PSA:
        s[PRESCALER] = (s[PRESCALER] + cycle - s[T0_AT]) & 0xFF
    s[TMR0] = value
    s[T0_AT] = cycle


@compiled
def t0_write(s: Vector, cycle: int, value: int, unknown: int) -> None:
    """Write TMR0 by an instruction in `cycle`; "increment is inhibited" (DS35007 section 5)."""
    t0_sync(s, cycle)
    s[TMR0] = value
    # From here on the byte counts, and a carry out of an unknown bit reaches all bits above it.
    s[TMR0_UNKNOWN] = upward(unknown & 0xFF) | unknown & ~0xFF
    # An anchor in the future: until then the timer reads the written value and counts nothing.
    s[T0_AT] = cycle + INHIBITED
    s[T0_HELD] = cycle + INHIBITED
    if not s[OPTION] & PSA:
        s[PRESCALER] = 0
        s[PRESCALER_UNKNOWN] = 0


@compiled
def t0_external(s: Vector, cycle: int) -> None:
    """Count an edge of T0CKI in `cycle`; an edge while the timer stands still is lost."""
    if cycle <= s[T0_HELD]:
        return
    shift = t0_shift(s)
    if shift:
        s[PRESCALER] = (s[PRESCALER] + 1) & 0xFF
        if s[PRESCALER] & ~s[PRESCALER_UNKNOWN] & ((1 << shift) - 1):
            return
    s[TMR0] = (s[TMR0] + 1) & 0xFF
    if s[TMR0_UNKNOWN]:
        timer_flag_in_doubt(s)
    if s[TMR0] == 0:
        s[INTCON] |= T0IF
        note_flags(s, cycle)


@compiled
def wdt_deadline(s: Vector) -> int:
    """Return the cycle of the next watchdog time-out, or NEVER (DS35007 section 6.10)."""
    if s[WDT_PERIOD] == 0:
        return NEVER
    periods = 1
    if s[OPTION] & PSA:
        division = 1 << (s[OPTION] & PS)
        periods = division - (s[PRESCALER] & (division - 1))
    return s[WDT_AT] + periods * s[WDT_PERIOD]


@compiled
def wdt_sync(s: Vector, cycle: int) -> None:
    """Account for the watchdog's periods up to `cycle`, which the prescaler counts if it is assigned to the
    watchdog.
    """
    if s[WDT_PERIOD] == 0:
        return
    periods = (cycle - s[WDT_AT]) // s[WDT_PERIOD]
    s[WDT_AT] += periods * s[WDT_PERIOD]
    if s[OPTION] & PSA:
        s[PRESCALER] = (s[PRESCALER] + periods) & 0xFF


@compiled
def settle_counters(s: Vector, cycle: int) -> None:
    """Update the slots to what the counters hold in `cycle`, so that the host can read them."""
    t0_sync(s, cycle)
    if cycle < wdt_deadline(s):
        wdt_sync(s, cycle)


@compiled
def wdt_clear(s: Vector, cycle: int) -> None:
    """Restart the watchdog at `cycle`, for CLRWDT or SLEEP; its prescaler becomes 0 if assigned to it."""
    if s[OPTION] & PSA:
        s[PRESCALER] = 0
        s[PRESCALER_UNKNOWN] = 0
    wdt_start(s, cycle)


@compiled
def wdt_start(s: Vector, cycle: int) -> None:
    """Begin the watchdog's period at `cycle`; the prescaler is unchanged."""
    s[WDT_AT] = cycle
    s[WDT_CLEARED] = cycle
    foresee(s)


@compiled
def foresee(s: Vector) -> None:
    """Set the cycle in which the watchdog of the chip with the shortest period would time out."""
    if s[WDT_SHORTEST] == 0:
        return
    periods = 1
    if s[OPTION] & PSA:
        division = 1 << (s[OPTION] & PS)
        periods = division - (s[PRESCALER] & (division - 1))
    s[WDT_EARLIEST] = s[WDT_CLEARED] + periods * s[WDT_SHORTEST]


@compiled
def option_write(s: Vector, cycle: int, value: int) -> None:
    """Apply a new `value` of OPTION_REG from `cycle`; the prescaler keeps its count when it is reassigned.

    The count of a prescaler assigned to the watchdog is unknown once the shortest period is over.
    """
    s[OPTION_WRITES] += 1
    # Everything is counted by the old clock up to `cycle`, then the new one takes over.
    t0_sync(s, cycle - 1)
    t0_advance(s, cycle)
    wdt_sync(s, cycle - 1)
    before = s[OPTION]
    s[OPTION] = value
    if s[WDT_SHORTEST] and (before ^ value) & (PSA | (PS if value & PSA else 0)):
        # Before the shortest period is over no chip's watchdog has advanced the prescaler.
        if cycle - s[WDT_CLEARED] < s[WDT_SHORTEST]:
            foresee(s)
        else:
            s[WDT_EARLIEST] = cycle
    # The timer's prescaler divides by twice as much as the watchdog's (DS35007 register 2-2).
    division = 1 << (value & PS) if value & PSA else 2 << (value & PS)
    if s[PRESCALER_UNKNOWN] & (division - 1) and value & PSA and s[WDT_SHORTEST]:
        s[WDT_EARLIEST] = cycle
    if s[PRESCALER_UNKNOWN] & (division - 1) and not value & PSA:
        s[TMR0_UNKNOWN] = 0xFF | SOURCE_PRESCALER << 8
    s[T0_AT] = max(s[T0_AT], cycle)
    if value & T0CS == 0:
        s[T0_TICK] = NEVER
        if (before ^ value) & (T0CS | PSA | (0 if value & PSA else PS)):
            s[T0_AT] = max(s[T0_AT], cycle + s[T0_PHASE])
