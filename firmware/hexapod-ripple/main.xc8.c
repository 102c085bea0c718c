/*
 * hexapod-ripple: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  L1-turn: 1365 to 1500 us
 * RB1  L1-lift: 1500 to 1666 us
 * RB2  L2-turn: 1365 to 1500 us
 * RB3  L2-lift: 1500 to 1666 us
 * RB4  L3-turn: 1365 to 1500 us
 * RB5  L3-lift: 1500 to 1666 us
 * RB6  R1-turn: 1500 to 1634 us
 * RB7  R1-lift: 1333 to 1500 us
 * RA0  R2-turn: 1500 to 1634 us
 * RA1  R2-lift: 1333 to 1500 us
 * RA2  R3-turn: 1500 to 1634 us
 * RA3  R3-lift: 1333 to 1500 us
 *
 * A frame takes 20000 us: 7 slots, each begun by TMR0, which counts 32 us and is never
 * written. The C between the slots may take any time that ends before the next one begins.
 *
 * What the motion does, part by part: where each foot goes, and the servos for it.
 *   segment 1 (forward_mm = 40), 0 to 2.08 s:
 *     L1 64 to 103.4, 108.5 to 121.7, -130 to -110 mm; L1-turn 41.6 to 71.3 deg: 1366 to 1448 us; L1-lift
 *     123.6 to 150 deg: 1593 to 1667 us
 *     L2 -26 to 13.4, 108.5 to 121.1, -130 to -110 mm; L2-turn 41.6 to 71.3 deg: 1366 to 1448 us; L2-lift
 *     123.6 to 150 deg: 1593 to 1667 us
 *     L3 -116 to -76.6, 108.5 to 121.1, -130 to -110 mm; L3-turn 41.6 to 71.3 deg: 1366 to 1448 us; L3-lift
 *     123.6 to 150 deg: 1593 to 1667 us
 *     R1 64 to 103.4, -121.1 to -108.5, -130 to -110 mm; R1-turn 41.6 to 71.3 deg: 1634 to 1552 us; R1-lift
 *     123.6 to 150 deg: 1407 to 1333 us
 *     R2 -26 to 13.4, -121.1 to -108.5, -130 to -110 mm; R2-turn 41.6 to 71.3 deg: 1634 to 1552 us; R2-lift
 *     123.6 to 150 deg: 1407 to 1333 us
 *     R3 -116 to -76.6, -121.2 to -108.5, -130 to -110 mm; R3-turn 41.6 to 71.3 deg: 1634 to 1552 us; R3-lift
 *     123.6 to 150 deg: 1407 to 1333 us
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

#define CHANNELS 12
#define SLOTS 7
#define HALF 128   /* of a 256th of a step: times are rounded to the nearest */

/* Poses, 6 bytes each, in steps of 1 us from each channel's base width. */
const unsigned char ROW[] = {
    95, 95, 95, 75, 75, 75,   /* 0 */
    169, 169, 169, 1, 1, 1,   /* 6 */
    2, 2, 2, 168, 168, 168,   /* 12 */
    137, 137, 137, 2, 2, 2,   /* 18 */
    44, 44, 44, 95, 95, 95,   /* 24 */
    26, 62, 44, 60, 130, 95,   /* 30 */
    44, 79, 9, 95, 113, 77,   /* 36 */
    62, 44, 26, 130, 95, 60,   /* 42 */
    79, 9, 44, 113, 77, 95,   /* 48 */
    44, 26, 62, 95, 60, 130,   /* 54 */
    9, 44, 79, 77, 95, 113   /* 60 */
};
#define COLUMNS 6   /* bytes of a pose */
#define LIFT_STANDING 0   /* the row of the lifts of legs that stand */
#define LIFT_HIGHEST 6   /* and of those that are lifted as high as they go */
#define LIFT_FIRST 12   /* and of all legs before the robot rises */
#define RISING 7   /* the place in the script up to which it has not risen */

/* Steps from pose to pose, each to the next row: the legs that it lifts, and in bits 0 and 1 its timing. Before a step there may be: */
#define TO_ROW 252   /* it goes to the row at the next byte */
/* 253: the legs step on the spot, from where they stand to the row at the next byte, as long as steps without a row follow. */
#define SCRIPT_END 26
#define SCRIPT_LOOP 18   /* where it goes on after its end */
#define TIMING_BITS 0x03
#define LEG_BITS 0xFC
const unsigned char SCRIPT[] = {
    252, 18, 0, 252, 18, 0, 0, 253, 60, 17, 33, 9, 129, 5, 1, 252, 60, 65, 252, 30, 17, 33, 9,
    129, 5, 65
};

/* All else that is constant, in one table, and where its parts begin. */
#define BASE_LOW 0   /* the channels' base widths */
#define SLOT_A 12   /* the pins that rise together in a slot */
#define SLOT_TICKS 19   /* ticks from the slot before */
#define SLOT_CHANNEL 26   /* the channel of pin A */
#define FRAMES 33   /* of a step; 0 is 256 */
#define SPEED_LOW 35   /* 65536ths of a step in a frame */
#define SPEED_HIGH 37
#define LAW 39   /* weights at each sixteenth of a step */
#define LIFT_LAW 56   /* of lifting */
#define SPOT_LAW 73   /* of turning on the spot */
const unsigned char CONSTANT[] = {
    83, 218, 83, 218, 83, 218, 218, 52, 218, 52, 218, 52,   /* BASE_LOW */
    0x01, 0x04, 0x10, 0x40, 0x01, 0x04, 0x00,   /* SLOT_A */
    155, 73, 73, 73, 72, 72, 107,   /* SLOT_TICKS */
    0, 2, 4, 6, 8, 10, 0,   /* SLOT_CHANNEL */
    50, 8,   /* FRAMES */
    31, 0,   /* SPEED_LOW */
    5, 32,   /* SPEED_HIGH */
    128, 133, 139, 145, 149, 151, 151, 148, 141, 132, 120, 104, 87, 67, 46, 23, 1,   /* LAW */
    0, 4, 14, 30, 49, 71, 95, 120, 144, 167, 189, 208, 225, 238, 248, 254, 255,   /* LIFT_LAW */
    0, 1, 1, 2, 5, 8, 13, 19, 27, 36, 46, 58, 71, 84, 99, 114, 128   /* SPOT_LAW */
};

unsigned char width_low[CHANNELS], width_high[CHANNELS];

/* The kernel's. */
unsigned char pulse_a_lo, pulse_a_hi, pulse_b_lo, pulse_b_hi, mask_a, mask_b, both, port;
unsigned char target, ahead, overrun, stay, fine, apart, count;

/* Where the motion is: in the script, in the step, and its two poses. */
unsigned char place, repeats, timing, frames, time, time_low, row, next_row;
unsigned char lifted, next_lifted;
unsigned char landed;   /* on the spot: the legs that have stepped, and a bit of no leg; 0: walking */

/* The arithmetic's. */
unsigned char channel, key, next, weight, value, value_low, value_high, bits, sign;

/* Between two frames the kernel's variables hold weights, and the legs that go backwards by a law: other names of them. */
#define swing_up pulse_a_lo
#define swing_down pulse_a_hi
#define lift_up pulse_b_lo
#define lift_down pulse_b_hi
#define lift stay
#define leg fine
#define swapped apart
#define back mask_a
#define standing mask_b
#define doubled both
#define law port

void blend(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // key * 256 + (next - key) * weight, the product twice where bit 1 of _sign is set: 16 bits.
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
    asm("    bcf     STATUS, 0");
    asm("    btfss   _sign, 1");
    asm("    goto    pl_once");
    asm("    rlf     _value_low, F");
    asm("    rlf     _value, F");
    asm("pl_once:");
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
    key = 5;
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // The width of a channel: base + value * steps + trim, in cycles.
    // In: _value, whole, and _value_low, the fraction; _key, _next: the base's bytes; _channel. Out: _key, _next.
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

/* The weights of half a swing at the time `bits`: of turning in swing_up, of lifting in value. */
void weigh_swing(void)
{
    next = law;
    weigh();
    swing_up = value;
    next = LIFT_LAW;
    weigh();
}

/* The widths of this frame. */
void make_widths(void)
{
    unsigned char column;

    if (landed) {
        law = SPOT_LAW;
        back = landed;
        standing = 0;
        doubled = 0;
    } else {
        law = LAW;
        back = next_lifted;
        standing = time;
        doubled = 2;
    }
    bits = ~time;
    weigh_swing();
    swing_down = swing_up;
    lift_down = value;
    bits = time;
    weigh_swing();
    lift_up = value;
    leg = 4;
    column = 0;
    for (channel = 0; channel < CHANNELS; channel++) {
        sign = 0;
        if (channel & 1) {
            key = column + LIFT_STANDING;
            next = column + LIFT_HIGHEST;
            weight = lift;
            if (place <= RISING) {
                next = key;
                key = column + LIFT_FIRST;
                if (place == RISING)
                    weight = time;
            }
            column++;
            leg <<= 1;
        } else {
            key = row + column;
            next = next_row + column;
            if (back & leg) {
                swapped = key;
                key = next;
                next = swapped;
            }
            lift = 0;
            weight = standing;
            if (next_lifted & leg) {
                weight = swing_up;
                lift = lift_up;
                sign = doubled;
            } else if (lifted & leg) {
                weight = swing_down;
                lift = lift_down;
                sign = doubled;
            }
        }
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
    if (timing >= TO_ROW) {
        row = next_row;
        landed = timing & 1;
        read_script();
        next_row = timing;
        read_script();
    } else if (landed)
        landed ^= next_lifted & LEG_BITS;   /* what falls in this step, from where it was highest */
    else {
        row = next_row;
        next_row += COLUMNS;
    }
    lifted = next_lifted;
    next_lifted = timing;
    timing &= TIMING_BITS;
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
        if (slot >= 4)
            port = 0x05;   /* PORTA */
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
    PORTA = 0x00;
    PORTB = 0x00;
    TRISA = 0x10;
    TRISB = 0x00;
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
