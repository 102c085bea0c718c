/*
 * scara-pick: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  shoulder: 1452 to 1750 us
 * RB1  elbow: 1500 to 1850 us
 * RB2  lift: 1250 to 1624 us
 * RB3  wrist: 1500 to 1612 us
 *
 * A frame takes 20000 us: 4 slots, each begun by TMR0, which counts 32 us and is never
 * written. The C between the slots may take any time that ends before the next one begins.
 *
 * What the motion does, part by part: its end, and the servos for it.
 *   pose 1, 0 to 0.5 s:
 *     tool 500, 200, 450 mm; shoulder 81.4 deg: 1452 us; elbow 143.9 deg: 1799 us; lift 0 deg: 1250 us; wrist
 *     124.4 deg: 1596 us
 *   pose 2, 0.5 to 2.42 s:
 *     tool 500, 200, 300 mm; shoulder 81.4 deg: 1452 us; elbow 143.9 deg: 1799 us; lift 135 deg: 1625 us;
 *     wrist 124.4 deg: 1596 us
 *   pose 3, 2.42 to 3.84 s:
 *     tool 500, 200, 450 mm; shoulder 81.4 deg: 1452 us; elbow 143.9 deg: 1799 us; lift 0 deg: 1250 us; wrist
 *     124.4 deg: 1596 us
 *   pose 4, 3.84 to 5.16 s:
 *     tool 50, 606, 450 mm; shoulder 135 deg: 1750 us; elbow 130.2 deg: 1724 us; lift 0 deg: 1250 us; wrist
 *     120 deg: 1583 us
 *   pose 5, 5.16 to 7.08 s:
 *     tool 50, 606, 300 mm; shoulder 135 deg: 1750 us; elbow 130.2 deg: 1724 us; lift 135 deg: 1625 us; wrist
 *     120 deg: 1583 us
 *   pose 6, 7.08 to 8.5 s:
 *     tool 50, 606, 450 mm; shoulder 135 deg: 1750 us; elbow 130.2 deg: 1724 us; lift 0 deg: 1250 us; wrist
 *     120 deg: 1583 us
 *   pose 1, 8.5 to 9.7 s:
 *     tool 500, 200, 450 mm; shoulder 81.4 deg: 1452 us; elbow 143.9 deg: 1799 us; lift 0 deg: 1250 us; wrist
 *     124.4 deg: 1596 us
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

#define CHANNELS 4
#define SLOTS 4
#define HALF 128   /* of a 256th of a step: times are rounded to the nearest */

/* Poses, 4 bytes each, in steps of 2 us from each channel's base width. */
const unsigned char ROW[] = {
    26, 2, 127, 2,   /* 0 */
    2, 152, 2, 50,   /* 4 */
    2, 152, 189, 50,   /* 8 */
    3, 153, 2, 50,   /* 12 */
    7, 160, 2, 52,   /* 16 */
    15, 167, 2, 54,   /* 20 */
    27, 174, 2, 56,   /* 24 */
    46, 177, 2, 58,   /* 28 */
    63, 175, 2, 58,   /* 32 */
    86, 167, 2, 57,   /* 36 */
    116, 148, 2, 53,   /* 40 */
    133, 133, 2, 49,   /* 44 */
    144, 122, 2, 46,   /* 48 */
    150, 115, 2, 44,   /* 52 */
    151, 114, 2, 44,   /* 56 */
    151, 114, 189, 44   /* 60 */
};
#define COLUMNS 4   /* bytes of a pose */

/* Steps from pose to pose, each to the next row: its timing. Before a step there may be: */
#define TO_ROW 252   /* it goes to the row at the next byte */
#define SCRIPT_END 44
#define SCRIPT_LOOP 7   /* where it goes on after its end */
const unsigned char SCRIPT[] = {
    252, 0, 0, 252, 0, 1, 0, 252, 4, 2, 3, 252, 8, 4, 252, 4, 3, 252, 12, 5, 5, 6, 6, 6, 7, 6,
    5, 6, 6, 6, 8, 3, 252, 60, 4, 252, 56, 3, 252, 4, 9, 252, 4, 10
};

/* All else that is constant, in one table, and where its parts begin. */
#define BASE_LOW 0   /* the channels' base widths */
#define BASE_HIGH 4
#define SLOT_A 8   /* the pins that rise together in a slot */
#define SLOT_TICKS 12   /* ticks from the slot before */
#define SLOT_CHANNEL 16   /* the channel of pin A */
#define FRAMES 20   /* of a step; 0 is 256 */
#define SPEED_LOW 31   /* 65536ths of a step in a frame */
#define SPEED_HIGH 42
#define TIMING_LAW 70   /* where its law begins; 255: straight, 254: at once, 252: no pulses */
const unsigned char CONSTANT[] = {
    168, 216, 222, 216,   /* BASE_LOW */
    5, 5, 4, 5,   /* BASE_HIGH */
    0x01, 0x04, 0x00, 0x00,   /* SLOT_A */
    150, 85, 178, 212,   /* SLOT_TICKS */
    0, 2, 0, 0,   /* SLOT_CHANNEL */
    50, 50, 24, 71, 25, 7, 5, 4, 6, 60, 1,   /* FRAMES */
    31, 31, 171, 155, 61, 146, 51, 0, 171, 68, 0,   /* SPEED_LOW */
    5, 5, 10, 3, 10, 36, 51, 64, 42, 4, 0,   /* SPEED_HIGH */
    0, 1, 4, 13, 27, 46, 71, 99, 129, 158, 186, 211, 230, 244, 253, 255, 255,   /* laws: weights at each sixteenth of a step */
    255, 254, 254, 53, 254, 255, 255, 255, 255, 53, 254   /* TIMING_LAW */
};
#define NO_PULSES 252   /* a timing without a law */
#define AT_ONCE 254

unsigned char width_low[CHANNELS], width_high[CHANNELS];

/* The kernel's. */
unsigned char pulse_a_lo, pulse_a_hi, pulse_b_lo, pulse_b_hi, mask_a, mask_b, both, port;
unsigned char target, ahead, overrun, stay, fine, apart, count;

/* Where the motion is: in the script, in the step, and its two poses. */
unsigned char place, repeats, timing, frames, time, time_low, row, next_row;

/* The arithmetic's. */
unsigned char channel, key, next, weight, value, value_low, value_high, bits, sign;

void blend(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // key * 256 + (next - key) * weight: 16 bits.
    // In: _key, _next, _weight, _sign (bit 0 clear). Out: _value, whole, and _value_low, the fraction.
    asm("    movf    _key, W");
    asm("    subwf   _next, W");
    asm("    btfsc   STATUS, 0");
    asm("    goto    pl_rising");
    asm("    sublw   0");   // key - next
    asm("    bsf     _sign, 0");
    asm("pl_rising:");
    asm("    movwf   _value_high");
    asm("    movf    _weight, W");
    asm("    movwf   _value_low");
    asm("    clrf    _value");
    asm("    movlw   8");
    asm("    movwf   _count");
    asm("    movf    _value_high, W");
    asm("    rrf     _value_low, F");
    asm("pl_between:");
    asm("    btfsc   STATUS, 0");
    asm("    addwf   _value, F");
    asm("    rrf     _value, F");
    asm("    rrf     _value_low, F");
    asm("    decfsz  _count, F");
    asm("    goto    pl_between");
    asm("    btfss   _sign, 0");
    asm("    goto    pl_sum");
    asm("    comf    _value, F");
    asm("    comf    _value_low, F");
    asm("    incf    _value_low, F");
    asm("    btfsc   STATUS, 2");
    asm("    incf    _value, F");
    asm("pl_sum:");
    asm("    movf    _key, W");
    asm("    addwf   _value, F");
}

/* One slot, to the cycle. */
void pulses(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // One slot of the frame: two servos of one port rise together and fall each at its own cycle.
    // 
    // STATUS bit 0 is the carry, bit 2 is zero.
    // 
    // In:  _pulse_a, _pulse_b    widths in cycles (_hi, _lo) of the two channels
    // _mask_a, _mask_b      their pins; the same width and mask 0 where a slot has one channel
    // _both                 both pins, or 0: no pulses
    // _port                 the port's address
    // _target, _ahead       TMR0 at which the slot begins, and the ticks since the slot before
    // Out: _overrun              bit 0 set where the slot's beginning had passed
    // 
    // The sooner pulse's width goes to _pulse_a, the difference to _pulse_b, the pin that stays high to _stay.
    asm("    movf    _pulse_a_lo, W");
    asm("    subwf   _pulse_b_lo, F");
    asm("    movf    _pulse_a_hi, W");
    asm("    btfss   STATUS, 0");
    asm("    incfsz  _pulse_a_hi, W");
    asm("    subwf   _pulse_b_hi, F");
    asm("    movf    _mask_b, W");
    asm("    btfsc   STATUS, 0");
    asm("    goto    pl_sorted");
    asm("    movf    _pulse_b_lo, W");
    asm("    addwf   _pulse_a_lo, F");
    asm("    btfsc   STATUS, 0");
    asm("    incf    _pulse_a_hi, F");
    asm("    movf    _pulse_b_hi, W");
    asm("    addwf   _pulse_a_hi, F");
    asm("    comf    _pulse_b_lo, F");
    asm("    comf    _pulse_b_hi, F");
    asm("    incf    _pulse_b_lo, F");
    asm("    btfsc   STATUS, 2");
    asm("    incf    _pulse_b_hi, F");
    asm("    movf    _mask_a, W");
    asm("pl_sorted:");
    asm("    movwf   _stay");
    asm("    movf    _pulse_b_lo, W");
    asm("    iorwf   _pulse_b_hi, W");
    asm("    btfsc   STATUS, 2");
    asm("    clrf    _stay");   // the same cycle: one write lowers both
    // The sooner pulse: 32 cycles are the way, the rest is loops of 8 cycles and 0 to 7 cycles in _fine.
    asm("    movlw   32");
    asm("    subwf   _pulse_a_lo, F");
    asm("    btfss   STATUS, 0");
    asm("    decf    _pulse_a_hi, F");
    asm("    movf    _pulse_a_lo, W");
    asm("    movwf   _fine");
    asm("    rrf     _pulse_a_hi, F");
    asm("    rrf     _pulse_a_lo, F");
    asm("    rrf     _pulse_a_hi, F");
    asm("    rrf     _pulse_a_lo, F");
    asm("    rrf     _pulse_a_hi, F");
    asm("    rrf     _pulse_a_lo, F");
    asm("    movlw   0x1F");
    asm("    andwf   _pulse_a_hi, F");
    asm("    incf    _pulse_a_lo, F");
    asm("    incf    _pulse_a_hi, F");
    // The difference d. _apart: bits 0 to 2 are (d - 2) mod 8, bit 3 d = 1, bit 4 d < 10, bit 5 d < 18.
    asm("    movlw   2");
    asm("    subwf   _pulse_b_lo, F");
    asm("    movlw   1");
    asm("    btfss   STATUS, 0");
    asm("    subwf   _pulse_b_hi, F");
    asm("    btfsc   STATUS, 0");
    asm("    goto    pl_apart");
    asm("    movlw   0x10");   // d = 0
    asm("    btfsc   _pulse_b_lo, 0");
    asm("    movlw   0x08");   // d = 1
    asm("    movwf   _apart");
    asm("    clrf    _pulse_b_lo");
    asm("    clrf    _pulse_b_hi");
    asm("    goto    pl_loops");
    asm("pl_apart:");
    asm("    movf    _pulse_b_lo, W");
    asm("    andlw   7");
    asm("    movwf   _apart");
    asm("    rrf     _pulse_b_hi, F");
    asm("    rrf     _pulse_b_lo, F");
    asm("    rrf     _pulse_b_hi, F");
    asm("    rrf     _pulse_b_lo, F");
    asm("    rrf     _pulse_b_hi, F");
    asm("    rrf     _pulse_b_lo, F");
    asm("    movlw   0x1F");
    asm("    andwf   _pulse_b_hi, F");
    asm("    movlw   2");
    asm("    subwf   _pulse_b_lo, F");
    asm("    movlw   1");
    asm("    btfss   STATUS, 0");
    asm("    subwf   _pulse_b_hi, F");
    asm("    btfsc   STATUS, 0");
    asm("    goto    pl_loops");
    asm("    movlw   0x10");
    asm("    btfsc   _pulse_b_lo, 0");
    asm("    movlw   0x20");
    asm("    iorwf   _apart, F");
    asm("    clrf    _pulse_b_lo");
    asm("    clrf    _pulse_b_hi");
    asm("pl_loops:");
    asm("    clrwdt");   // a watchdog that was left on is cleared before the pulses and after them
    asm("    incf    _pulse_b_lo, F");
    asm("    incf    _pulse_b_hi, F");
    asm("    movf    _port, W");
    asm("    movwf   FSR");
    // Is the beginning still to come? Then less than _ahead ticks have passed since the slot before: a carry.
    asm("    movf    _target, W");
    asm("pl_check:");
    asm("    subwf   TMR0, W");
    asm("    addwf   _ahead, W");
    asm("    btfss   STATUS, 0");
    asm("    bsf     _overrun, 0");
    // The lock. The poll sees TMR0 = _target 0 to 4 cycles after it came about, 3 where the look above was in the
    // last cycle before it. A tick is 32 cycles.
    asm("pl_poll:");
    asm("    movf    TMR0, W");   // cycle 0 to 4 of the tick
    asm("    xorwf   _target, W");
    asm("    btfss   STATUS, 2");
    asm("    goto    pl_poll");
    asm("    incf    _target, F");   // 4
    asm("    movlw   7");
    asm("    movwf   _count");
    asm("pl_pad1:");
    asm("    decfsz  _count, F");
    asm("    goto    pl_pad1");
    asm("    goto    $+1");
    asm("    movf    _target, W");   // 29
    asm("    subwf   TMR0, W");   // 30: the next tick has come where the poll was 2 to 4 late
    asm("    btfss   STATUS, 2");
    asm("    goto    $+1");
    asm("    btfss   STATUS, 2");
    asm("    goto    $+1");
    asm("    incf    _target, F");   // 37, 0 to 2 late
    asm("    movlw   7");
    asm("    movwf   _count");
    asm("pl_pad2:");
    asm("    decfsz  _count, F");
    asm("    goto    pl_pad2");
    asm("    goto    $+1");
    asm("    movf    _target, W");   // 62
    asm("    subwf   TMR0, W");   // 63: come where 1 or 2 late
    asm("    btfss   STATUS, 2");
    asm("    goto    $+1");
    asm("    incf    _target, F");   // 67, 0 or 1 late
    asm("    movlw   8");
    asm("    movwf   _count");
    asm("pl_pad3:");
    asm("    decfsz  _count, F");
    asm("    goto    pl_pad3");
    asm("    nop");
    asm("    movf    _target, W");   // 94
    asm("    subwf   TMR0, W");   // 95: come where 1 late
    asm("    btfss   STATUS, 2");
    asm("    goto    $+1");
    // Cycle 99 after the beginning, always.
    asm("    movf    _both, W");
    asm("    btfsc   STATUS, 2");
    asm("    goto    pl_done");   // no pulses
    asm("    movwf   INDF");   // both rise: cycle 0
    asm("    movf    _stay, W");
    asm("    btfsc   _fine, 0");
    asm("    goto    $+1");
    asm("    btfsc   _fine, 1");
    asm("    goto    $+1");
    asm("    btfsc   _fine, 1");
    asm("    goto    $+1");
    asm("    btfss   _fine, 2");
    asm("    goto    pl_loop1");
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    nop");
    asm("pl_loop1:");
    asm("    goto    $+1");
    asm("    nop");
    asm("    decfsz  _pulse_a_lo, F");
    asm("    goto    $+2");
    asm("    decfsz  _pulse_a_hi, F");
    asm("    goto    pl_loop1");
    // 14 cycles to the first fall, whatever the way. W keeps the pin that stays high.
    asm("    btfsc   _apart, 3");
    asm("    goto    pl_one");
    asm("    btfss   _apart, 0");
    asm("    goto    $+1");
    asm("    btfss   _apart, 2");
    asm("    goto    pl_0to3");
    asm("    nop");
    asm("    btfss   _apart, 1");
    asm("    goto    pl_4or5");
    asm("    nop");
    asm("    btfss   _apart, 0");
    asm("    goto    pl_6");
    asm("    goto    pl_7");
    asm("pl_4or5:");
    asm("    btfss   _apart, 0");
    asm("    goto    pl_4");
    asm("    goto    pl_5");
    asm("pl_0to3:");
    asm("    btfss   _apart, 1");
    asm("    goto    pl_0or1");
    asm("    nop");
    asm("    btfss   _apart, 0");
    asm("    goto    pl_2");
    asm("    goto    pl_3");
    asm("pl_0or1:");
    asm("    btfss   _apart, 0");
    asm("    goto    pl_0");
    asm("    goto    pl_1");
    asm("pl_one:");
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    nop");
    asm("    movwf   INDF");   // the first fall
    asm("    clrf    INDF");   // the other, the next cycle
    asm("    goto    pl_done");
    // The first fall; writing the same again changes no pin, and takes the cycles.
    asm("pl_7:");
    asm("    movwf   INDF");
    asm("pl_6:");
    asm("    movwf   INDF");
    asm("pl_5:");
    asm("    movwf   INDF");
    asm("pl_4:");
    asm("    movwf   INDF");
    asm("pl_3:");
    asm("    movwf   INDF");
    asm("pl_2:");
    asm("    movwf   INDF");
    asm("pl_1:");
    asm("    movwf   INDF");
    asm("pl_0:");
    asm("    movwf   INDF");
    asm("    btfsc   _apart, 4");
    asm("    clrf    INDF");   // 2 to 9 cycles after the first fall
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    btfsc   _apart, 5");
    asm("    clrf    INDF");   // 10 to 17
    asm("pl_loop2:");
    asm("    goto    $+1");
    asm("    nop");
    asm("    decfsz  _pulse_b_lo, F");
    asm("    goto    $+2");
    asm("    decfsz  _pulse_b_hi, F");
    asm("    goto    pl_loop2");
    asm("    clrf    INDF");   // 18 and more
    asm("pl_done:");
    asm("    clrwdt");
    asm("    movlw   3");
    asm("    subwf   _target, F");   // where the lock began
}

/* The weight of the time `bits` by the law at CONSTANT[next], in value. */
void weigh(void)
{
    next += bits >> 4;
    key = CONSTANT[next];
    next++;
    next = CONSTANT[next];
    weight = bits << 4;
    sign = 0;
    blend();
}

/* The width of a channel, by a weight between two bytes of poses, at key and next in ROW. */
void make_width(void)
{
    key = ROW[key];
    next = ROW[next];
    blend();
    next = CONSTANT[BASE_LOW + channel];
    key = CONSTANT[BASE_HIGH + channel];
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // The width of a channel: base + value * steps + trim, in cycles.
    // In: _value, whole, and _value_low, the fraction; _key, _next: the base's bytes; _channel. Out: _key, _next.
    asm("    clrf    _value_high");
    asm("    bcf     STATUS, 0");   // twice
    asm("    rlf     _value_low, F");
    asm("    rlf     _value, F");
    asm("    rlf     _value_high, F");
    asm("    movf    _value_high, W");
    asm("    addwf   _key, F");
    asm("    movf    _value, W");
    asm("    addwf   _next, F");
    asm("    btfsc   STATUS, 0");
    asm("    incf    _key, F");
    // The trim is the channel's byte of the data EEPROM (DS35007 section 3.1), in two's complement; 0xFF: none.
    asm("    movf    _channel, W");
    asm("    movwf   EEADR");
    asm("    bsf     STATUS, 5");   // bank 1
    asm("    bsf     0x08, 0");   // EECON1, RD
    asm("    bcf     STATUS, 5");
    asm("    incf    EEDATA, W");
    asm("    btfsc   STATUS, 2");
    asm("    goto    pl_width");
    asm("    movf    EEDATA, W");
    asm("    addwf   _next, F");
    asm("    btfsc   STATUS, 0");
    asm("    incf    _key, F");
    asm("    btfsc   EEDATA, 7");
    asm("    decf    _key, F");
    asm("pl_width:");
}

/* The widths of this frame. */
void make_widths(void)
{
    unsigned char now;

    now = time;
    next = CONSTANT[TIMING_LAW + timing];
    if (next < NO_PULSES) {
        bits = time;
        weigh();
        now = value;
    }
    for (channel = 0; channel < CHANNELS; channel++) {
        sign = 0;
        key = row + channel;
        next = next_row + channel;
        weight = now;
        make_width();
        width_low[channel] = next;
        width_high[channel] = key;
    }
}

/* The script's byte at its place, in timing. */
void read_script(void)
{
    if (place == SCRIPT_END)
        place = SCRIPT_LOOP;
    timing = SCRIPT[place];
    place++;
}

/* On to the next step of the script. */
void next_step(void)
{
    read_script();
    row = next_row;
    next_row += COLUMNS;
    if (timing == TO_ROW) {
        read_script();
        next_row = timing;
        read_script();
    }
    if ((CONSTANT[TIMING_LAW + timing] | (AT_ONCE ^ NO_PULSES)) == AT_ONCE)   /* one of the two */
        row = next_row;
    frames = CONSTANT[FRAMES + timing];
    time = 0;
    time_low = HALF;
}

/* To the first step. */
void rewind(void)
{
    place = 0;
    next_step();
    next_step();
}

/* On to the next frame. */
void step(void)
{
    unsigned char more;

    more = CONSTANT[SPEED_LOW + timing];
    time_low += more;
    if (time_low < more)
        time++;
    time += CONSTANT[SPEED_HIGH + timing];
    frames--;
    if (frames == 0)
        next_step();
}

/* All slots of a frame. */
void play(void)
{
    unsigned char slot, at;

    for (slot = 0; slot < SLOTS; slot++) {
        at = CONSTANT[SLOT_CHANNEL + slot];
        mask_a = CONSTANT[SLOT_A + slot];
        mask_b = mask_a << 1;
        port = 0x06;   /* the address of PORTB */
        ahead = CONSTANT[SLOT_TICKS + slot];
        target += ahead;
        both = mask_a | mask_b;
        pulse_a_lo = width_low[at];
        pulse_a_hi = width_high[at];
        at++;
        pulse_b_lo = width_low[at];
        pulse_b_hi = width_high[at];
        pulses();
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xF0;
    OPTION_REG = 0x84;   /* TMR0 counts cycles, 1:32 */
    TMR0 = 0;   /* unknown at power-up */
    overrun = 0;
    rewind();
    target = TMR0;
    while (1) {
        make_widths();
        play();
        step();
    }
}
