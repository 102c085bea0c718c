"""Ports A and B: output latches, direction, the levels of the pins, and the resulting edges. Compiled.

DS35007 section 4. A latch and a pin are two things: an instruction reads the pin, and writes the latch. RA4
is an open drain (section 4.1): with its latch at 1 nothing drives it. Levels of pins that nobody drives:
port B's weak pull-ups when RBPU is 0 (section 4.2), else `FLOATING`.
"""

from __future__ import annotations

from servogen.pic.device import masks
from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.interrupts import INTF, RBIF, note_flags
from servogen.simulator.layout import (
    ANY_INPUT,
    CYCLE,
    DRIVEN,
    DRIVEN_FROM,
    DRIVEN_HIGH,
    DRIVEN_UNKNOWN,
    EDGE_COUNT,
    EDGES_TOTAL,
    EXT_LEVEL,
    EXT_MASK,
    FLOATING,
    FLOATING_PIN,
    GLITCH,
    HERE,
    IN_RESET,
    INTCON,
    INTCON_UNKNOWN,
    LATCH,
    LATCH_UNKNOWN,
    OPTION,
    PACK_CYCLE,
    PACK_PIN,
    PINS,
    PINS_UNKNOWN,
    PULLED_UP,
    PULSED,
    RA4_PULLED_UP,
    RB_OLD,
    RB_OLD_UNKNOWN,
    RELEASED,
    SLEEPING,
    T0_TICK,
    T0CS,
    T0SE,
    TRACKED,
    TRIS,
    UNWRITTEN_LATCH,
    USE_DIRECTION,
    USE_OUTPUT,
    WARN_CONTENTION,
    WARN_DRIVEN_UNWRITTEN,
    WARN_PULLED_UP,
    WARN_RELEASED,
)
from servogen.simulator.timer import t0_runs
from servogen.simulator.unknown import doubt, flags_in_doubt, use
from servogen.simulator.warn import warn, warn_of

A, B = 0x001F, 0x1FE0
"""The bits of each port in a 13-bit port word."""
B_SHIFT = 5
RA4, RB0, RB4_TO_7 = 1 << 4, 1 << B_SHIFT, 0xF0 << B_SHIFT
PIN_COUNT = 13
RBPU, INTEDG = masks("RBPU", "INTEDG")
T0CKI_DELAY = 1
"""Cycles from an edge of T0CKI to its count: 3 to 7 oscillator periods (DS30430 figure 6-5)."""


@compiled
def settle(s: Vector, cycle: int) -> None:
    """Compute the levels of the pins from latches, directions and the outside world, from `cycle`."""
    # RA4 is an open drain: a latch of 1 releases the pin.
    driven = ~s[TRIS] & (A | B)
    if s[LATCH] & RA4:
        driven &= ~RA4
    outside = s[EXT_MASK]
    if (outside & driven) and (outside & driven & (s[EXT_LEVEL] ^ s[LATCH])):
        contention(s, outside & driven & (s[EXT_LEVEL] ^ s[LATCH]))
    if s[PULSED]:
        note_released(s)
    resting = s[FLOATING]
    if not s[OPTION] & RBPU:
        resting |= B
    if s[RA4_PULLED_UP]:
        resting |= RA4
    level = (resting & ~outside) | (s[EXT_LEVEL] & outside)
    level = (level & ~driven) | (s[LATCH] & driven)
    changed = level ^ s[PINS]
    s[PINS] = level
    if not s[TRACKED]:
        if changed:
            react(s, cycle, changed)
        return
    held = outside | (0 if s[OPTION] & RBPU else B) | (RA4 if s[RA4_PULLED_UP] else 0)
    if s[ANY_INPUT]:
        held = outside  # a pull-up gives way to whatever drives the pin
    unknown = ~(driven | held) & (A | B) | s[LATCH_UNKNOWN] & driven
    # A pin that stops being unknown may have changed just now, too.
    seen = unknown | s[PINS_UNKNOWN]
    s[PINS_UNKNOWN] = unknown
    if changed:
        react(s, cycle, changed)
    if seen & (RA4 | RB0 | RB4_TO_7):
        flags_in_doubt(s, seen)
        compare(s)
        doubt(s, t0_runs(s))


@compiled
def react(s: Vector, cycle: int, changed: int) -> None:
    """Apply changed pins to T0CKI, INT and the change interrupt (DS35007 sections 5, 6.8.1, 6.8.3)."""
    rising = changed & s[PINS]
    if (
        changed & RA4
        and s[OPTION] & T0CS
        and not s[SLEEPING]
        and not s[IN_RESET]
        and (rising & RA4 == 0) == (s[OPTION] & T0SE != 0)
    ):
        s[T0_TICK] = cycle + T0CKI_DELAY
    if changed & RB0 and (rising & RB0 != 0) == (s[OPTION] & INTEDG != 0):
        s[INTCON] |= INTF
    compare(s)
    note_flags(s, cycle)


@compiled
def compare(s: Vector) -> None:
    """Set RBIF while an input of RB4 to RB7 differs from the value last read (DS35007 section 4.2)."""
    differs = (s[PINS] ^ s[RB_OLD]) & s[TRIS] & RB4_TO_7
    unknown = (s[PINS_UNKNOWN] | s[RB_OLD_UNKNOWN]) & s[TRIS] & RB4_TO_7
    if differs & ~unknown:
        s[INTCON_UNKNOWN] &= ~RBIF
    elif unknown and not s[INTCON] & RBIF & ~s[INTCON_UNKNOWN]:
        s[INTCON_UNKNOWN] |= RBIF
    if differs:
        s[INTCON] |= RBIF


@compiled
def contention(s: Vector, bits: int) -> None:
    """Warn of pins that the chip and the outside world drive to different levels."""
    for pin in range(PIN_COUNT):
        if bits >> pin & 1:
            warn(s, WARN_CONTENTION, pin)


@compiled
def note_released(s: Vector) -> None:
    """Warn of pins with pulses that are inputs after the first pulse: the chip does not hold them low."""
    s[RELEASED] |= s[TRIS]
    pull_ups = (0 if s[OPTION] & RBPU else B) | (RA4 if s[RA4_PULLED_UP] else 0)
    s[PULLED_UP] |= s[TRIS] & pull_ups & ~s[EXT_MASK]
    released, pulled_up = s[RELEASED] & s[PULSED], s[PULLED_UP] & s[PULSED]
    for pin in range(PIN_COUNT if released else 0):
        if released >> pin & 1:
            warn(s, WARN_RELEASED, pin)
        if pulled_up >> pin & 1:
            warn(s, WARN_PULLED_UP, pin)


@compiled
def emit(s: Vector, edges: Vector, cycle: int) -> None:
    """Record every change of a driven pin, in pin order, as made by the instruction of `cycle`."""
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
                s[PULSED] |= level << pin & ~s[LATCH_UNKNOWN]
            edges[count] = cycle << PACK_CYCLE | pin << PACK_PIN | level
            count += 1
        changed >>= 1
        pin += 1
    s[EDGES_TOTAL] += count - s[EDGE_COUNT]
    s[EDGE_COUNT] = count


@compiled
def port_write(s: Vector, edges: Vector, cycle: int, port: int, value: int, unknown: int) -> None:
    """Write a latch by an instruction in `cycle`; `port` is A or B. A write to port B reads it too."""
    bits = unknown & 0xFF
    if port == A:
        s[LATCH] = (s[LATCH] & B) | (value & A)
        s[LATCH_UNKNOWN] = (s[LATCH_UNKNOWN] & B) | (bits & A)
    else:
        s[LATCH] = (s[LATCH] & A) | value << B_SHIFT
        s[LATCH_UNKNOWN] = (s[LATCH_UNKNOWN] & A) | bits << B_SHIFT
        read_port_b(s)
    if s[DRIVEN_UNKNOWN] & port:
        settle_unknown(s, cycle, port)
    if s[TRACKED] and bits:
        outputs_in_doubt(s, ~s[TRIS] & port & ~s[DRIVEN_UNKNOWN], unknown >> 8)
    emit(s, edges, cycle)
    settle(s, cycle + 1)


@compiled
def read_port_b(s: Vector) -> None:
    """Read port B, so that its change interrupt compares with this value from now on."""
    s[RB_OLD] = s[PINS]
    s[RB_OLD_UNKNOWN] = s[PINS_UNKNOWN] & RB4_TO_7


@compiled
def outputs_in_doubt(s: Vector, driven: int, source: int) -> None:
    """Note a use if one of these outputs has been written with an unknown level."""
    unknown = driven & s[LATCH_UNKNOWN]
    if unknown:
        for pin in range(PIN_COUNT):
            if unknown >> pin & 1:
                use(s, USE_OUTPUT, pin, source)


@compiled
def drive_unknown(s: Vector, pins: int) -> None:
    """Note that these pins become outputs while their latches are unknown; `settle_unknown` evaluates
    this.
    """
    for pin in range(PIN_COUNT):
        if pins >> pin & 1:
            s[DRIVEN_FROM + 2 * pin] = s[CYCLE]
            s[DRIVEN_FROM + 2 * pin + 1] = s[HERE]
    s[DRIVEN_UNKNOWN] |= pins


@compiled
def settle_unknown(s: Vector, cycle: int, pins: int) -> None:
    """Evaluate a write, in `cycle`, to the latch or direction of these pins, of which some are driven with
    an unknown level.

    Before the first pulse, a pin that is written low after at most GLITCH cycles is accepted: no chip made
    more than a glitch.
    """
    waiting = s[DRIVEN_UNKNOWN] & pins
    for pin in range(PIN_COUNT):
        bit = 1 << pin
        if waiting & bit and (s[TRIS] & bit or not s[LATCH_UNKNOWN] & bit):
            s[DRIVEN_UNKNOWN] &= ~bit
            high = s[LATCH] & bit and not s[TRIS] & bit
            if high or s[PULSED] or cycle - s[DRIVEN_FROM + 2 * pin] > GLITCH:
                warn_of(
                    s,
                    WARN_DRIVEN_UNWRITTEN,
                    pin,
                    s[DRIVEN_FROM + 2 * pin],
                    s[DRIVEN_FROM + 2 * pin + 1],
                )


@compiled
def unknown_of_port(s: Vector, port: int, bits: int) -> int:
    """Return the unknown bits of a port that is read, with the source of one of `bits`."""
    mask = (s[PINS_UNKNOWN] & A) if port == A else s[PINS_UNKNOWN] >> B_SHIFT
    if mask == 0:
        return 0
    pin = 0 if port == A else B_SHIFT
    wanted = mask & bits if mask & bits else mask
    while not wanted & 1:
        wanted >>= 1
        pin += 1
    return mask | (FLOATING_PIN if s[TRIS] >> pin & 1 else UNWRITTEN_LATCH) + pin << 8


@compiled
def tris_write(s: Vector, edges: Vector, cycle: int, port: int, value: int, unknown: int) -> None:
    """Write a port's direction by an instruction in `cycle`: 0 makes a pin an output."""
    if unknown:
        use(s, USE_DIRECTION, 0 if port == A else 1, unknown >> 8)
    before = s[TRIS]
    if port == A:
        s[TRIS] = (before & B) | (value & A)
    else:
        s[TRIS] = (before & A) | value << B_SHIFT
    if s[DRIVEN_UNKNOWN] & port:
        settle_unknown(s, cycle, port)
    fresh = before & ~s[TRIS] & s[LATCH_UNKNOWN]
    if fresh:
        drive_unknown(s, fresh)
    emit(s, edges, cycle)
    settle(s, cycle + 1)
    compare(s)
    note_flags(s, cycle + 1)


@compiled
def outside(s: Vector, cycle: int, pin: int, level: int) -> None:
    """Apply an external level to a pin from `cycle`: 0 or 1, or 2 to release it."""
    bit = 1 << pin
    s[EXT_MASK] &= ~bit
    s[EXT_LEVEL] &= ~bit
    if level < 2:
        s[EXT_MASK] |= bit
        s[EXT_LEVEL] |= level << pin
    settle(s, cycle)
