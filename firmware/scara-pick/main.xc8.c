/*
 * scara-pick: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  shoulder: 1451 to 1751 us
 * RB1  elbow: 1501 to 1849 us
 * RB2  lift: 1249 to 1625 us
 * RB3  wrist: 1501 to 1613 us
 *
 * A frame takes 20000 us: 4 slots, each begun by TMR0, which counts 32 us and is never
 * written. The C between the slots may take any time that ends before the next one begins.
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

/* Slots: the pins of one port that rise together, the port's address, ticks from the slot before. */
const unsigned char SLOT_A[] = { 0x01, 0x04, 0x00, 0x00 };
const unsigned char SLOT_B[] = { 0x02, 0x08, 0x00, 0x00 };
const unsigned char SLOT_PORT[] = { 0x06, 0x06, 0x06, 0x06 };
const unsigned char SLOT_TICKS[] = { 150, 85, 178, 212 };
const unsigned char SLOT_CHANNEL[] = { 0, 2, 0, 0 };

/* Parts of the motion: frames (0 is 256), repeats, time of a frame in 256ths of a keyframe, keyframes that go round, row. */
const unsigned char PART_FRAMES[] = { 50, 50, 24, 71, 25, 208, 25, 132 };
const unsigned char PART_REPEATS[] = { 1, 1, 1, 1, 1, 1, 1, 1 };
const unsigned char PART_SPEED[] = { 1, 4, 1, 32, 1, 32, 1, 32 };
const unsigned char PART_WRAP[] = { 1, 255, 1, 255, 1, 255, 1, 255 };
const unsigned char PART_ROW[] = { 0, 4, 8, 12, 16, 20, 24, 28 };

/* Rows, for each channel: its first keyframe, and 2 * keyframes ahead + 1 where mirrored. */
const unsigned char TRACK[] = { 0, 0, 0, 0, 189, 183, 185, 187, 1, 2, 3, 4, 120, 50, 173, 23, 1, 2, 5, 4, 85, 50, 130, 23, 6, 7, 5, 8, 103, 67, 156, 8 };
const unsigned char AHEAD[] = { 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0 };

/* Keyframes, in steps of 2 us from each channel's base width. */
const unsigned char KEYFRAME[] = { 63, 39, 212, 188, 110, 0, 187, 174, 104, 104, 104, 104, 104, 104, 104, 104, 104, 104, 104, 105, 106, 108, 109, 110, 110, 110, 110, 110, 110, 110, 110, 110, 110, 111, 113, 117, 119, 116, 110, 105, 104, 104, 104, 104, 104, 104, 104, 104, 104, 104, 212, 212, 212, 212, 212, 212, 212, 212, 212, 212, 214, 224, 236, 237, 220, 196, 178, 174, 174, 174, 174, 174, 174, 174, 174, 174, 174, 175, 179, 187, 197, 205, 211, 212, 212, 39, 39, 39, 39, 39, 39, 39, 39, 39, 38, 39, 47, 66, 99, 137, 167, 185, 188, 187, 187, 187, 187, 187, 187, 187, 187, 187, 188, 185, 167, 136, 99, 65, 44, 38, 39, 39, 39, 39, 39, 39, 39, 39, 39, 39, 0, 1, 14, 40, 76, 116, 152, 176, 187, 188, 187, 188, 188, 188, 188, 188, 187, 188, 187, 176, 152, 116, 76, 40, 14, 1, 0, 1, 14, 40, 76, 116, 152, 176, 187, 188, 187, 188, 188, 188, 188, 188, 188, 188, 186, 174, 148, 111, 71, 36, 11, 1, 0, 63, 254, 63, 223, 63, 124, 63, 32 };
const unsigned char BASE_LOW[] = { 95, 95, 89, 95 };
const unsigned char BASE_HIGH[] = { 5, 5, 6, 5 };

unsigned char width_low[4], width_high[4];

/* The kernel's. */
unsigned char pulse_a_lo, pulse_a_hi, pulse_b_lo, pulse_b_hi, mask_a, mask_b, both, port;
unsigned char target, ahead, overrun, stay, fine, apart, count;

/* Where the motion is. */
unsigned char part, repeats, frames, segment, time;
unsigned char channel, key, next, value, value_low, value_high, bits, trim;

/* The interpolation leaves a channel's way from its base in value_high, value: cycles. */
void between(void)
{
    // The value between two keyframes: eight times (value + the keyframe that the time's next bit chooses) / 2.
    // In: _key, _next, _time. Out: _value, whole, and _value_low, the fraction. _time is kept.
    asm("    movf    _time, W");
    asm("    movwf   _bits");
    asm("    movf    _key, W");
    asm("    movwf   _value");
    asm("    clrf    _value_low");
    asm("    movlw   8");
    asm("    movwf   _count");
    asm("pl_between:");
    asm("    rrf     _bits, F");
    asm("    movf    _key, W");
    asm("    btfsc   STATUS, 0");
    asm("    movf    _next, W");
    asm("    addwf   _value, F");
    asm("    rrf     _value, F");
    asm("    rrf     _value_low, F");
    asm("    decfsz  _count, F");
    asm("    goto    pl_between");
    asm("    clrf    _value_high");
    asm("    bcf     STATUS, 0");   // twice
    asm("    rlf     _value_low, F");
    asm("    rlf     _value, F");
    asm("    rlf     _value_high, F");
}

void read_trim(void)
{
    // The channel's byte of the data EEPROM (DS35007 section 3.1).
    asm("    movf    _channel, W");
    asm("    movwf   EEADR");
    asm("    bsf     STATUS, 5");   // bank 1
    asm("    bsf     0x08, 0");   // EECON1, RD
    asm("    bcf     STATUS, 5");
    asm("    movf    EEDATA, W");
    asm("    movwf   _trim");
}

/* One slot, to the cycle. */
void pulses(void)
{
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

/* The widths of this frame. */
void make_widths(void)
{
    unsigned char at, mode, row, wrap;

    wrap = PART_WRAP[part];
    row = PART_ROW[part];
    for (channel = 0; channel < 4; channel++) {
        mode = AHEAD[row];
        at = segment + (mode >> 1);
        if (at >= wrap)
            at -= wrap;
        key = KEYFRAME[TRACK[row] + at];
        at++;
        if (at == wrap)
            at = 0;
        next = KEYFRAME[TRACK[row] + at];
        row++;
        between();
        at = BASE_LOW[channel];
        key = BASE_HIGH[channel];
        if (mode & 1) {
            if (at < value)
                key--;
            at -= value;
            key -= value_high;
        } else {
            at += value;
            if (at < value)
                key++;
            key += value_high;
        }
        read_trim();
        if (trim != 0xFF) {
            at += trim;
            if (at < trim)
                key++;
            if (trim & 0x80)
                key--;
        }
        width_low[channel] = at;
        width_high[channel] = key;
    }
}

void begin_part(void)
{
    frames = PART_FRAMES[part];
    segment = 0;
    time = 0;
}

/* To the first part. */
void rewind(void)
{
    part = 0;
    repeats = PART_REPEATS[0];
    begin_part();
}

/* On to the next frame. */
void step(void)
{
    time += PART_SPEED[part];
    if (time == 0)
        segment++;
    if (--frames != 0)
        return;
    if (--repeats == 0) {
        part++;
        if (part == 8)
            part = 2;
        repeats = PART_REPEATS[part];
    }
    begin_part();
}

/* All slots of a frame. */
void play(void)
{
    unsigned char slot, at;

    for (slot = 0; slot < 4; slot++) {
        at = SLOT_CHANNEL[slot];
        mask_a = SLOT_A[slot];
        mask_b = SLOT_B[slot];
        port = SLOT_PORT[slot];
        ahead = SLOT_TICKS[slot];
        target += ahead;
        both = mask_a | mask_b;
        pulse_a_lo = width_low[at];
        pulse_a_hi = width_high[at];
        if (mask_b != 0)
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
