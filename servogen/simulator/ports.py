"""Ports A and B: output latches, direction, what the pins carry, and the edges that come of it. Compiled.

DS35007 section 4. A latch and a pin are two things: an instruction reads the pin, and writes the latch. RA4
is an open drain (section 4.1): with its latch at 1 nothing drives it. Levels of pins that nobody drives:
port B's weak pull-ups when RBPU is 0 (section 4.2), else `FLOATING`.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.interrupts import INTF, RBIF, note_flags
from servogen.simulator.layout import (
    DRIVEN,
    DRIVEN_HIGH,
    EDGE_COUNT,
    EDGES_TOTAL,
    EXT_LEVEL,
    EXT_MASK,
    FLOATING,
    IN_RESET,
    INTCON,
    LATCH,
    LATCH_WRITTEN,
    OPTION,
    PACK_CYCLE,
    PACK_PIN,
    PINS,
    RA4_PULLED_UP,
    RB_OLD,
    SLEEPING,
    T0_TICK,
    TRIS,
    WARN_CONTENTION,
    WARN_DRIVEN_UNWRITTEN,
)
from servogen.simulator.timer import T0CS, T0SE
from servogen.simulator.warn import warn

A, B = 0x001F, 0x1FE0
"""The bits of each port in a 13-bit port word."""
B_SHIFT = 5
RA4, RB0, RB4_TO_7 = 1 << 4, 1 << B_SHIFT, 0xF0 << B_SHIFT
PIN_COUNT = 13
RBPU, INTEDG = 0x80, 0x40  # of OPTION_REG
T0CKI_DELAY = 1
"""Cycles from an edge of T0CKI to its count: 3 to 7 oscillator periods (DS30430 figure 6-5)."""


@compiled
def settle(s: Vector, at: int) -> None:
    """The pins are as latches, directions and the world outside make them, from cycle `at`."""
    driven = ~s[TRIS] & (A | B)
    if s[LATCH] & RA4:
        driven &= ~RA4
    outside = s[EXT_MASK]
    if (outside & driven) and (outside & driven & (s[EXT_LEVEL] ^ s[LATCH])):
        contention(s, outside & driven & (s[EXT_LEVEL] ^ s[LATCH]))
    resting = s[FLOATING]
    if not s[OPTION] & RBPU:
        resting |= B
    if s[RA4_PULLED_UP]:
        resting |= RA4
    level = (resting & ~outside) | (s[EXT_LEVEL] & outside)
    level = (level & ~driven) | (s[LATCH] & driven)
    changed = level ^ s[PINS]
    s[PINS] = level
    if changed:
        react(s, at, changed)


@compiled
def react(s: Vector, at: int, changed: int) -> None:
    """What T0CKI, INT and the change interrupt make of changed pins: DS35007 sections 5, 6.8.1, 6.8.3."""
    rising = changed & s[PINS]
    if (
        changed & RA4
        and s[OPTION] & T0CS
        and not s[SLEEPING]
        and not s[IN_RESET]
        and (rising & RA4 == 0) == (s[OPTION] & T0SE != 0)
    ):
        s[T0_TICK] = at + T0CKI_DELAY
    if changed & RB0 and (rising & RB0 != 0) == (s[OPTION] & INTEDG != 0):
        s[INTCON] |= INTF
    compare(s)
    note_flags(s, at)


@compiled
def compare(s: Vector) -> None:
    """RBIF is set as long as an input of RB4 to RB7 differs from what was last read: DS35007 section 4.2."""
    if (s[PINS] ^ s[RB_OLD]) & s[TRIS] & RB4_TO_7:
        s[INTCON] |= RBIF


@compiled
def contention(s: Vector, bits: int) -> None:
    for pin in range(PIN_COUNT):
        if bits >> pin & 1:
            warn(s, WARN_CONTENTION, pin)


@compiled
def emit(s: Vector, edges: Vector, at: int) -> None:
    """Note every change of what the chip drives, in order of pins: the instruction of cycle `at` made it."""
    driven = ~s[TRIS] & (A | B)
    if s[LATCH] & RA4 and not s[RA4_PULLED_UP]:
        driven &= ~RA4
    high = s[LATCH] & driven
    changed = (driven ^ s[DRIVEN]) | (high ^ s[DRIVEN_HIGH])
    s[DRIVEN] = driven
    s[DRIVEN_HIGH] = high
    count = s[EDGE_COUNT]
    pin = 0
    while changed:
        if changed & 1:
            level = 2
            if driven >> pin & 1:
                level = high >> pin & 1
            edges[count] = at << PACK_CYCLE | pin << PACK_PIN | level
            count += 1
        changed >>= 1
        pin += 1
    s[EDGES_TOTAL] += count - s[EDGE_COUNT]
    s[EDGE_COUNT] = count


@compiled
def port_write(s: Vector, edges: Vector, at: int, port: int, value: int) -> None:
    """An instruction in cycle `at` writes a latch; `port` is A or B. A write of port B reads it too."""
    s[LATCH_WRITTEN] |= port
    if port == A:
        s[LATCH] = (s[LATCH] & B) | (value & A)
    else:
        s[LATCH] = (s[LATCH] & A) | value << B_SHIFT
        s[RB_OLD] = s[PINS]
    emit(s, edges, at)
    settle(s, at + 1)


@compiled
def tris_write(s: Vector, edges: Vector, at: int, port: int, value: int) -> None:
    """An instruction in cycle `at` writes a port's direction: 0 makes a pin an output."""
    before = s[TRIS]
    if port == A:
        s[TRIS] = (before & B) | (value & A)
    else:
        s[TRIS] = (before & A) | value << B_SHIFT
    unwritten = before & ~s[TRIS] & ~s[LATCH_WRITTEN]
    if unwritten:
        for pin in range(PIN_COUNT):
            if unwritten >> pin & 1:
                warn(s, WARN_DRIVEN_UNWRITTEN, pin)
    emit(s, edges, at)
    settle(s, at + 1)
    compare(s)
    note_flags(s, at + 1)


@compiled
def outside(s: Vector, at: int, pin: int, level: int) -> None:
    """The world drives a pin from cycle `at`: level 0 or 1, or 2 to let it go."""
    bit = 1 << pin
    s[EXT_MASK] &= ~bit
    s[EXT_LEVEL] &= ~bit
    if level < 2:
        s[EXT_MASK] |= bit
        s[EXT_LEVEL] |= level << pin
    settle(s, at)
