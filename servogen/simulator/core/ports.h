/* Ports A and B: output latches, direction, the levels of the pins, and the resulting edges.

   DS35007 section 4. A latch and a pin are two things: an instruction reads the pin, and writes the latch.
   RA4 is an open drain (section 4.1): with its latch at 1 nothing drives it. Levels of pins that nobody
   drives: port B's weak pull-ups when RBPU is 0 (section 4.2), resistors on the board, else `floating`. */

#ifndef PORTS_H
#define PORTS_H

#include "timer.h"
#include "warn.h"

enum {
    PORT_A = 0x1F, /* the bits of each port in a port word; layout.py has PORT_B */
    B_SHIFT = 5,
    PIN_COUNT = 13,
    DRIVEN_TOO = 1 + (1 << PIN_COUNT), /* by which pins are multiplied for both parts of a device's word */
    T0CKI_DELAY = 1, /* cycles from an edge of T0CKI to its count: 3 to 7 oscillator periods (figure 6-5) */
};

/* Returns the pins that the devices on them pull low, once these have their levels, from `cycle`, and above
   bit 12 those whose levels are known by that on every chip. `pins` has above bit 12 those that the chip
   drives to an unknown level. */
typedef i64 (*React)(i64 cycle, i64 pins);

/* Returns the pins with a pull-up that is on. */
static inline i64 pull_ups(const Chip *s)
{
    return (s->option & RBPU ? 0 : PORT_B) | s->resistors;
}

/* Sets RBIF while an input of RB4 to RB7 differs from the value last read (DS35007 section 4.2). */
static void compare(Chip *s)
{
    i64 differs = (s->pins ^ s->rb_old) & s->tris & RB4_TO_7;
    i64 unknown = (s->pins_unknown | s->rb_old_unknown) & s->tris & RB4_TO_7;
    if (differs & ~unknown)
        s->intcon_unknown &= ~RBIF;
    else if (unknown && !(s->intcon & RBIF & ~s->intcon_unknown))
        s->intcon_unknown |= RBIF;
    if (differs)
        s->intcon |= RBIF;
}

/* Applies changed pins to T0CKI, INT and the change interrupt (DS35007 sections 5, 6.8.1, 6.8.3). */
static void react(Chip *s, i64 cycle, i64 changed)
{
    i64 rising = changed & s->pins;
    bool counts = s->option & T0CS && !s->sleeping && !s->in_reset;
    if (changed & RA4 && counts && !(rising & RA4) == !!(s->option & T0SE))
        s->t0_tick = cycle + T0CKI_DELAY;
    if (changed & RB0 && !!(rising & RB0) == !!(s->option & INTEDG))
        s->intcon |= INTF;
    compare(s);
    note_flags(s, cycle);
}

/* Warns of each of these pins. */
RARE void warn_pins(Chip *s, i64 code, i64 pins)
{
    for (i64 pin = 0; pin < PIN_COUNT; pin++)
        if (pins >> pin & 1)
            warn(s, code, pin);
}

/* Warns of pins with pulses that are inputs after the first pulse: the chip does not hold them low. */
static void note_released(Chip *s)
{
    s->released |= s->tris;
    s->pulled_up |= s->tris & pull_ups(s) & ~s->ext_mask;
    i64 released = s->released & s->pulsed, pulled_up = s->pulled_up & s->pulsed;
    for (i64 pin = 0; pin < (released ? PIN_COUNT : 0); pin++) {
        if (released >> pin & 1)
            warn(s, WARN_RELEASED, pin);
        if (pulled_up >> pin & 1)
            warn(s, WARN_PULLED_UP, pin);
    }
}

/* Computes the levels of the pins from latches, directions and the outside world, from `cycle`. */
static void settle_levels(Chip *s, i64 cycle)
{
    i64 driven = ~s->tris & ALL_PINS;
    if (s->latch & RA4)
        driven &= ~RA4; /* an open drain: a latch of 1 releases the pin */
    i64 low = s->device_answer & ALL_PINS;
    i64 outside = s->ext_mask | low, outside_level = s->ext_level & ~low;
    if (outside & driven & (outside_level ^ s->latch)) /* the chip and the outside drive different levels */
        warn_pins(s, WARN_CONTENTION, outside & driven & (outside_level ^ s->latch));
    if (s->pulsed)
        note_released(s);
    i64 resting = s->floating | pull_ups(s);
    i64 level = (resting & ~outside) | outside_level;
    level = (level & ~driven) | (s->latch & driven);
    i64 changed = level ^ s->pins;
    s->pins = level;
    if (!s->tracked) {
        if (changed)
            react(s, cycle, changed);
        return;
    }
    /* The prover's pull-ups give way to whatever drives the pin, but for what a device it follows lets go. */
    i64 held = s->any_input ? outside | s->device_answer >> PIN_COUNT : outside | pull_ups(s);
    i64 unknown = (~(driven | held) & ALL_PINS) | (s->latch_unknown & driven);
    /* A pin that stops being unknown may have changed just now, too. */
    i64 seen = unknown | s->pins_unknown;
    s->pins_unknown = unknown;
    if (changed)
        react(s, cycle, changed);
    if (seen & (RA4 | RB0 | RB4_TO_7)) {
        flags_in_doubt(s, seen);
        compare(s);
        doubt(s, t0_runs(s));
    }
}

/* Tells the devices on the pins of their new levels until they answer the same. */
RARE void tell_devices(Chip *s, i64 cycle)
{
    React react = (React)(intptr_t)s->devices;
    for (;;) {
        i64 levels = (s->pins | (s->latch_unknown & ~s->tris) << PIN_COUNT) & s->device_pins * DRIVEN_TOO;
        if (levels == s->device_told)
            return;
        s->device_told = levels;
        i64 answer = react(cycle, levels);
        if (answer == s->device_answer)
            return;
        s->device_answer = answer;
        settle_levels(s, cycle);
    }
}

/* Settles the levels of the pins, and what devices on them answer in the same cycle. */
static void settle(Chip *s, i64 cycle)
{
    settle_levels(s, cycle);
    if (s->device_pins)
        tell_devices(s, cycle);
}

/* Records every change of a driven pin, in pin order, as made by the instruction of `cycle`. */
static void emit(Chip *s, i64 *edges, i64 cycle)
{
    i64 driven = ~s->tris & ALL_PINS;
    if (s->latch & RA4 && !(s->resistors & RA4))
        driven &= ~RA4;
    i64 high = s->latch & driven;
    i64 changed = (driven ^ s->driven) | (high ^ s->driven_high);
    s->driven = driven;
    s->driven_high = high;
    i64 count = s->edge_count;
    for (i64 pin = 0; changed; changed >>= 1, pin++) {
        if (!(changed & 1))
            continue;
        i64 level = driven >> pin & 1 ? high >> pin & 1 : 2;
        if (level < 2)
            s->pulsed |= level << pin & ~s->latch_unknown;
        edges[count++] = cycle << PACK_CYCLE | pin << PACK_PIN | level;
    }
    s->edges_total += count - s->edge_count;
    s->edge_count = count;
}

/* Reads port B, so that its change interrupt compares with this value from now on. */
static inline void read_port_b(Chip *s)
{
    s->rb_old = s->pins;
    s->rb_old_unknown = s->pins_unknown & RB4_TO_7;
}

/* Notes a use if one of these outputs has been written with an unknown level. */
RARE void outputs_in_doubt(Chip *s, i64 driven, i64 source)
{
    for (i64 pin = 0; pin < PIN_COUNT; pin++)
        if ((driven & s->latch_unknown) >> pin & 1)
            use(s, USE_OUTPUT, pin, source);
}

/* Notes that these pins become outputs while their latches are unknown; `settle_unknown` evaluates this. */
RARE void drive_unknown(Chip *s, i64 pins)
{
    for (i64 pin = 0; pin < PIN_COUNT; pin++)
        if (pins >> pin & 1) {
            s->driven_from[2 * pin] = s->cycle;
            s->driven_from[2 * pin + 1] = s->here;
        }
    s->driven_unknown |= pins;
}

/* Evaluates a write, in `cycle`, to the latch or direction of these pins, of which some are driven with an
   unknown level.

   Before the first pulse, a pin that is written low after at most GLITCH cycles is accepted: no chip made
   more than a glitch. */
RARE void settle_unknown(Chip *s, i64 cycle, i64 pins)
{
    i64 waiting = s->driven_unknown & pins;
    for (i64 pin = 0; pin < PIN_COUNT; pin++) {
        i64 bit = (i64)1 << pin;
        if (!(waiting & bit && (s->tris & bit || !(s->latch_unknown & bit))))
            continue;
        s->driven_unknown &= ~bit;
        bool high = s->latch & bit && !(s->tris & bit);
        const i64 *from = s->driven_from + 2 * pin;
        if (high || s->pulsed || cycle - from[0] > GLITCH)
            warn_of(s, WARN_DRIVEN_UNWRITTEN, pin, from[0], from[1]);
    }
}

/* Writes a latch by an instruction in `cycle`; `port` is PORT_A or PORT_B. A write to port B reads it too. */
static void port_write(Chip *s, i64 *edges, i64 cycle, i64 port, i64 value, i64 unknown)
{
    i64 bits = unknown & 0xFF;
    if (port == PORT_A) {
        s->latch = (s->latch & PORT_B) | (value & PORT_A);
        s->latch_unknown = (s->latch_unknown & PORT_B) | (bits & PORT_A);
    } else {
        s->latch = (s->latch & PORT_A) | value << B_SHIFT;
        s->latch_unknown = (s->latch_unknown & PORT_A) | bits << B_SHIFT;
        read_port_b(s);
    }
    if (s->driven_unknown)
        settle_unknown(s, cycle, port);
    if (s->tracked && bits)
        outputs_in_doubt(s, ~s->tris & port & ~s->driven_unknown, unknown >> 8);
    emit(s, edges, cycle);
    settle(s, cycle + 1);
}

/* Returns the unknown bits of a port that is read, with the source of one of `bits`. */
static inline i64 unknown_of_port(const Chip *s, i64 port, i64 bits)
{
    i64 mask = port == PORT_A ? s->pins_unknown & PORT_A : s->pins_unknown >> B_SHIFT;
    if (mask == 0)
        return 0;
    i64 pin = port == PORT_A ? 0 : B_SHIFT;
    i64 wanted = mask & bits ? mask & bits : mask;
    for (; !(wanted & 1); wanted >>= 1)
        pin++;
    return mask | ((s->tris >> pin & 1 ? FLOATING_PIN : UNWRITTEN_LATCH) + pin) << 8;
}

/* Writes a port's direction by an instruction in `cycle`: 0 makes a pin an output. */
static void tris_write(Chip *s, i64 *edges, i64 cycle, i64 port, i64 value, i64 unknown)
{
    if (unknown)
        use(s, USE_DIRECTION, port == PORT_A ? 0 : 1, unknown >> 8);
    i64 before = s->tris;
    s->tris = port == PORT_A ? (before & PORT_B) | (value & PORT_A) : (before & PORT_A) | value << B_SHIFT;
    if (s->driven_unknown)
        settle_unknown(s, cycle, port);
    i64 fresh = before & ~s->tris & s->latch_unknown;
    if (fresh)
        drive_unknown(s, fresh);
    emit(s, edges, cycle);
    settle(s, cycle + 1);
    compare(s);
    note_flags(s, cycle + 1);
}

/* Applies an external level to a pin from `cycle`: 0 or 1, or 2 to release it. */
static void outside(Chip *s, i64 cycle, i64 pin, i64 level)
{
    i64 bit = (i64)1 << pin;
    s->ext_mask &= ~bit;
    s->ext_level &= ~bit;
    if (level < 2) {
        s->ext_mask |= bit;
        s->ext_level |= level << pin;
    }
    settle(s, cycle);
}

#endif
