"""The effect of a reset on the registers. Compiled.

DS35007 section 6.4, tables 6-3 and 6-4. "x" (unknown at power-up) is 0 here, except in RAM, whose reads are
recorded until it is written.
"""

from __future__ import annotations

from servogen.pic.device import masks
from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.eeprom import reset_eecon1
from servogen.simulator.layout import (
    AWAKE_AT,
    DEPTH,
    HERE,
    INTCON,
    INTCON_UNKNOWN,
    IRQ_AT,
    NEVER,
    OPTION,
    PC,
    PCLATH,
    PINS_UNKNOWN,
    PRESCALER,
    PRESCALER_UNKNOWN,
    PULLED_UP,
    PULSED,
    RELEASED,
    RESETS_MCLR,
    RESETS_MCLR_SLEEP,
    RESETS_WDT,
    SLEEPING,
    SP,
    STATUS,
    T0_AT,
    T0_HELD,
    T0_TICK,
    TRACKED,
    TRIS,
)
from servogen.simulator.ports import A, B, compare, emit, settle
from servogen.simulator.timer import t0_advance, wdt_start
from servogen.simulator.unknown import flags_in_doubt

TO, PD = masks("TO", "PD")
KEPT_STATUS = sum(masks("Z", "DC", "C"))
(RBIF_KEPT,) = masks("RBIF")
FETCH = 1
"""Cycles from the end of a reset to the instruction at 0000h: its fetch."""


@compiled
def enter_reset(s: Vector, edges: Vector, cycle: int) -> None:
    """Apply a reset other than power-up, in `cycle`."""
    t0_advance(s, cycle)
    s[PC] = 0
    s[HERE] = 0
    s[PCLATH] = 0
    s[OPTION] = 0xFF  # T0CS: TMR0 keeps its count
    s[T0_AT] = cycle
    s[T0_HELD] = cycle
    s[AWAKE_AT] = cycle
    s[T0_TICK] = NEVER
    s[TRIS] = A | B
    s[SLEEPING] = 0
    s[SP] = 0
    s[DEPTH] = 0
    s[PRESCALER] = 0
    s[PRESCALER_UNKNOWN] = 0
    s[PULSED] = s[RELEASED] = s[PULLED_UP] = 0
    wdt_start(s, cycle)
    reset_eecon1(s)
    emit(s, edges, cycle)
    settle(s, cycle)
    s[INTCON] &= RBIF_KEPT
    s[INTCON_UNKNOWN] &= RBIF_KEPT
    s[IRQ_AT] = NEVER
    compare(s)
    if s[TRACKED]:
        flags_in_doubt(s, s[PINS_UNKNOWN])


@compiled
def watchdog_reset(s: Vector, edges: Vector, cycle: int) -> None:
    """Reset a running chip by the watchdog (DS35007 table 6-3)."""
    s[STATUS] = (s[STATUS] & KEPT_STATUS) | PD
    s[RESETS_WDT] += 1
    enter_reset(s, edges, cycle)


@compiled
def mclr_reset(s: Vector, edges: Vector, cycle: int) -> None:
    """Reset the chip by MCLR, running or asleep (DS35007 table 6-3)."""
    if s[SLEEPING]:
        s[STATUS] = (s[STATUS] & KEPT_STATUS) | TO
        s[RESETS_MCLR_SLEEP] += 1
    else:
        s[STATUS] &= KEPT_STATUS | TO | PD
        s[RESETS_MCLR] += 1
    enter_reset(s, edges, cycle)
