/*
 * hexapod-wave: servo pulses for the PIC16F84 at 4 MHz (C2C).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  L1-turn: 1446 to 1554 us
 * RB1  L1-lift: 1497 to 1648 us
 * RB2  L2-turn: 1441 to 1554 us
 * RB3  L2-lift: 1496 to 1649 us
 * RB4  L3-turn: 1438 to 1554 us
 * RB5  L3-lift: 1494 to 1649 us
 * RB6  R1-turn: 1446 to 1562 us
 * RB7  R1-lift: 1352 to 1503 us
 * RA0  R2-turn: 1446 to 1560 us
 * RA1  R2-lift: 1352 to 1503 us
 * RA2  R3-turn: 1446 to 1557 us
 * RA3  R3-lift: 1352 to 1503 us
 *
 * A frame takes 20000 us: 7 slots, each begun by TMR0, which counts 32 us and is never
 * written. The C between the slots may take any time that ends before the next one begins.
 */
#pragma CLOCK_FREQ 4000000

/* Slots: the pins of one port that rise together, the port's address, ticks from the slot before. */
const unsigned char SLOT_A[] = { 0x01, 0x04, 0x10, 0x40, 0x01, 0x04, 0x00 };
const unsigned char SLOT_B[] = { 0x02, 0x08, 0x20, 0x80, 0x02, 0x08, 0x00 };
const unsigned char SLOT_PORT[] = { 0x06, 0x06, 0x06, 0x06, 0x05, 0x05, 0x06 };
const unsigned char SLOT_TICKS[] = { 156, 73, 73, 73, 70, 70, 110 };
const unsigned char SLOT_CHANNEL[] = { 0, 2, 4, 6, 8, 10, 0 };

/* Parts of the motion: frames (0 is 256), repeats, time of a frame in 256ths of a keyframe, keyframes that go round, row. */
const unsigned char PART_FRAMES[] = { 50, 128, 96 };
const unsigned char PART_REPEATS[] = { 1, 1, 1 };
const unsigned char PART_SPEED[] = { 1, 32, 128 };
const unsigned char PART_WRAP[] = { 1, 255, 48 };
const unsigned char PART_ROW[] = { 0, 12, 24 };

/* Rows, for each channel: its first keyframe, and 2 * keyframes ahead + 1 where mirrored. */
const unsigned char TRACK[] = { 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 108, 93, 208, 125, 225, 141, 191, 87, 174, 89, 157, 91, 0, 48, 0, 48, 0, 48, 0, 48, 0, 48, 0, 48 };
const unsigned char AHEAD[] = { 1, 0, 1, 0, 1, 0, 0, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1, 0, 0, 1, 0, 1, 0, 1, 1, 0, 17, 16, 33, 32, 48, 49, 64, 65, 80, 81 };

/* Keyframes, in steps of 1 us from each channel's base width. */
const unsigned char KEYFRAME[] = { 1, 0, 9, 28, 54, 80, 99, 108, 107, 104, 102, 99, 97, 94, 91, 89, 86, 84, 81, 78, 76, 73, 70, 68, 65, 62, 59, 57, 54, 51, 49, 46, 43, 40, 38, 35, 32, 30, 27, 24, 22, 19, 17, 14, 11, 9, 6, 4, 52, 78, 130, 173, 190, 173, 130, 78, 52, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 54, 55, 51, 202, 51, 55, 54, 54, 54, 54, 54, 54, 54, 54, 54, 52, 50, 41, 73, 103, 91, 85, 75, 65, 54, 43, 32, 22, 11, 1, 54, 55, 50, 202, 51, 55, 54, 54, 54, 54, 54, 54, 54, 55, 50, 203, 48, 203, 50, 55, 54, 54, 54, 54, 54, 54, 54, 55, 51, 202, 50, 55, 54, 54, 52, 49, 45, 42, 28, 70, 111, 95, 87, 76, 65, 54, 43, 32, 22, 54, 54, 52, 49, 45, 41, 34, 30, 12, 64, 114, 95, 87, 76, 65, 54, 43, 54, 54, 52, 49, 45, 40, 34, 28, 19, 13, 0, 54, 116, 94, 87, 76, 65, 54, 54, 49, 71, 92, 83, 79, 71, 63, 54, 44, 33, 22, 14, 0, 53, 122, 51, 67, 80, 75, 72, 67, 61, 54, 46, 37, 26, 18, 0, 56, 116, 94, 87 };
const unsigned char BASE_LOW[] = { 18, 166, 18, 166, 18, 166, 166, 18, 166, 18, 166, 18 };
const unsigned char BASE_HIGH[] = { 6, 5, 6, 5, 6, 5, 5, 6, 5, 6, 5, 6 };

unsigned char width_low[12], width_high[12];

/* The kernel's. */
unsigned char pulse_a_lo, pulse_a_hi, pulse_b_lo, pulse_b_hi, mask_a, mask_b, both, port;
unsigned char target, ahead, overrun, stay, fine, apart, count;

/* Where the motion is. */
unsigned char part, repeats, frames, segment, time;
unsigned char channel, key, next, value, value_low, value_high, bits, trim;

/* The interpolation leaves a channel's way from its base in value_high, value: cycles. */
void between(void)
{
    asm {
; The value between two keyframes: eight times (value + the keyframe that the time's next bit chooses) / 2.
; In: _key, _next, _time. Out: _value, whole, and _value_low, the fraction. _time is kept.
    movf    _time, W
    movwf   _bits
    movf    _key, W
    movwf   _value
    clrf    _value_low
    movlw   8
    movwf   _count
pl_between:
    rrf     _bits, F
    movf    _key, W
    btfsc   STATUS, 0
    movf    _next, W
    addwf   _value, F
    rrf     _value, F
    rrf     _value_low, F
    decfsz  _count, F
    goto    pl_between
    clrf    _value_high
    }
}

void read_trim(void)
{
    asm {
; The channel's byte of the data EEPROM (DS35007 section 3.1).
    movf    _channel, W
    movwf   EEADR
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 0             ; EECON1, RD
    bcf     STATUS, 5
    movf    EEDATA, W
    movwf   _trim
    }
}

/* One slot, to the cycle. */
void pulses(void)
{
    asm {
; One slot of the frame: two servos of one port rise together and fall each at its own cycle.

; STATUS bit 0 is the carry, bit 2 is zero.

; In:  _pulse_a, _pulse_b    widths in cycles (_hi, _lo) of the two channels
; _mask_a, _mask_b      their pins; the same width and mask 0 where a slot has one channel
; _both                 both pins, or 0: no pulses
; _port                 the port's address
; _target, _ahead       TMR0 at which the slot begins, and the ticks since the slot before
; Out: _overrun              bit 0 set where the slot's beginning had passed

; The sooner pulse's width goes to _pulse_a, the difference to _pulse_b, the pin that stays high to _stay.
    movf    _pulse_a_lo, W
    subwf   _pulse_b_lo, F
    movf    _pulse_a_hi, W
    btfss   STATUS, 0
    incfsz  _pulse_a_hi, W
    subwf   _pulse_b_hi, F
    movf    _mask_b, W
    btfsc   STATUS, 0
    goto    pl_sorted
    movf    _pulse_b_lo, W
    addwf   _pulse_a_lo, F
    btfsc   STATUS, 0
    incf    _pulse_a_hi, F
    movf    _pulse_b_hi, W
    addwf   _pulse_a_hi, F
    comf    _pulse_b_lo, F
    comf    _pulse_b_hi, F
    incf    _pulse_b_lo, F
    btfsc   STATUS, 2
    incf    _pulse_b_hi, F
    movf    _mask_a, W
pl_sorted:
    movwf   _stay
    movf    _pulse_b_lo, W
    iorwf   _pulse_b_hi, W
    btfsc   STATUS, 2
    clrf    _stay               ; the same cycle: one write lowers both
; The sooner pulse: 32 cycles are the way, the rest is loops of 8 cycles and 0 to 7 cycles in _fine.
    movlw   32
    subwf   _pulse_a_lo, F
    btfss   STATUS, 0
    decf    _pulse_a_hi, F
    movf    _pulse_a_lo, W
    movwf   _fine
    rrf     _pulse_a_hi, F
    rrf     _pulse_a_lo, F
    rrf     _pulse_a_hi, F
    rrf     _pulse_a_lo, F
    rrf     _pulse_a_hi, F
    rrf     _pulse_a_lo, F
    movlw   0x1F
    andwf   _pulse_a_hi, F
    incf    _pulse_a_lo, F
    incf    _pulse_a_hi, F
; The difference d. _apart: bits 0 to 2 are (d - 2) mod 8, bit 3 d = 1, bit 4 d < 10, bit 5 d < 18.
    movlw   2
    subwf   _pulse_b_lo, F
    movlw   1
    btfss   STATUS, 0
    subwf   _pulse_b_hi, F
    btfsc   STATUS, 0
    goto    pl_apart
    movlw   0x10                ; d = 0
    btfsc   _pulse_b_lo, 0
    movlw   0x08                ; d = 1
    movwf   _apart
    clrf    _pulse_b_lo
    clrf    _pulse_b_hi
    goto    pl_loops
pl_apart:
    movf    _pulse_b_lo, W
    andlw   7
    movwf   _apart
    rrf     _pulse_b_hi, F
    rrf     _pulse_b_lo, F
    rrf     _pulse_b_hi, F
    rrf     _pulse_b_lo, F
    rrf     _pulse_b_hi, F
    rrf     _pulse_b_lo, F
    movlw   0x1F
    andwf   _pulse_b_hi, F
    movlw   2
    subwf   _pulse_b_lo, F
    movlw   1
    btfss   STATUS, 0
    subwf   _pulse_b_hi, F
    btfsc   STATUS, 0
    goto    pl_loops
    movlw   0x10
    btfsc   _pulse_b_lo, 0
    movlw   0x20
    iorwf   _apart, F
    clrf    _pulse_b_lo
    clrf    _pulse_b_hi
pl_loops:
    clrwdt                      ; a watchdog that was left on is cleared before the pulses and after them
    incf    _pulse_b_lo, F
    incf    _pulse_b_hi, F
    movf    _port, W
    movwf   FSR
; Is the beginning still to come? Then less than _ahead ticks have passed since the slot before: a carry.
    movf    _target, W
pl_check:
    subwf   TMR0, W
    addwf   _ahead, W
    btfss   STATUS, 0
    bsf     _overrun, 0
; The lock. The poll sees TMR0 = _target 0 to 4 cycles after it came about, 3 where the look above was in the
; last cycle before it. A tick is 32 cycles.
pl_poll:
    movf    TMR0, W             ; cycle 0 to 4 of the tick
    xorwf   _target, W
    btfss   STATUS, 2
    goto    pl_poll
    incf    _target, F          ; 4
    movlw   7
    movwf   _count
pl_pad1:
    decfsz  _count, F
    goto    pl_pad1
    goto    $+1
    movf    _target, W          ; 29
    subwf   TMR0, W             ; 30: the next tick has come where the poll was 2 to 4 late
    btfss   STATUS, 2
    goto    $+1
    btfss   STATUS, 2
    goto    $+1
    incf    _target, F          ; 37, 0 to 2 late
    movlw   7
    movwf   _count
pl_pad2:
    decfsz  _count, F
    goto    pl_pad2
    goto    $+1
    movf    _target, W          ; 62
    subwf   TMR0, W             ; 63: come where 1 or 2 late
    btfss   STATUS, 2
    goto    $+1
    incf    _target, F          ; 67, 0 or 1 late
    movlw   8
    movwf   _count
pl_pad3:
    decfsz  _count, F
    goto    pl_pad3
    nop
    movf    _target, W          ; 94
    subwf   TMR0, W             ; 95: come where 1 late
    btfss   STATUS, 2
    goto    $+1
; Cycle 99 after the beginning, always.
    movf    _both, W
    btfsc   STATUS, 2
    goto    pl_done             ; no pulses
    movwf   INDF                ; both rise: cycle 0
    movf    _stay, W
    btfsc   _fine, 0
    goto    $+1
    btfsc   _fine, 1
    goto    $+1
    btfsc   _fine, 1
    goto    $+1
    btfss   _fine, 2
    goto    pl_loop1
    goto    $+1
    goto    $+1
    nop
pl_loop1:
    goto    $+1
    nop
    decfsz  _pulse_a_lo, F
    goto    $+2
    decfsz  _pulse_a_hi, F
    goto    pl_loop1
; 14 cycles to the first fall, whatever the way. W keeps the pin that stays high.
    btfsc   _apart, 3
    goto    pl_one
    btfss   _apart, 0
    goto    $+1
    btfss   _apart, 2
    goto    pl_0to3
    nop
    btfss   _apart, 1
    goto    pl_4or5
    nop
    btfss   _apart, 0
    goto    pl_6
    goto    pl_7
pl_4or5:
    btfss   _apart, 0
    goto    pl_4
    goto    pl_5
pl_0to3:
    btfss   _apart, 1
    goto    pl_0or1
    nop
    btfss   _apart, 0
    goto    pl_2
    goto    pl_3
pl_0or1:
    btfss   _apart, 0
    goto    pl_0
    goto    pl_1
pl_one:
    goto    $+1
    goto    $+1
    goto    $+1
    goto    $+1
    goto    $+1
    nop
    movwf   INDF                ; the first fall
    clrf    INDF                ; the other, the next cycle
    goto    pl_done
; The first fall; writing the same again changes no pin, and takes the cycles.
pl_7:
    movwf   INDF
pl_6:
    movwf   INDF
pl_5:
    movwf   INDF
pl_4:
    movwf   INDF
pl_3:
    movwf   INDF
pl_2:
    movwf   INDF
pl_1:
    movwf   INDF
pl_0:
    movwf   INDF
    btfsc   _apart, 4
    clrf    INDF                ; 2 to 9 cycles after the first fall
    goto    $+1
    goto    $+1
    goto    $+1
    btfsc   _apart, 5
    clrf    INDF                ; 10 to 17
pl_loop2:
    goto    $+1
    nop
    decfsz  _pulse_b_lo, F
    goto    $+2
    decfsz  _pulse_b_hi, F
    goto    pl_loop2
    clrf    INDF                ; 18 and more
pl_done:
    clrwdt
    movlw   3
    subwf   _target, F          ; where the lock began
    }
}

/* The widths of this frame. */
void make_widths(void)
{
    unsigned char at, mode, row, wrap;

    wrap = PART_WRAP[part];
    row = PART_ROW[part];
    for (channel = 0; channel < 12; channel++) {
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
        if (part == 3)
            part = 2;
        repeats = PART_REPEATS[part];
    }
    begin_part();
}

/* All slots of a frame. */
void play(void)
{
    unsigned char slot, at;

    for (slot = 0; slot < 7; slot++) {
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
    PORTA = 0x00;
    PORTB = 0x00;
    set_bit(STATUS, RP0);
    TRISA = 0x10;
    TRISB = 0x00;
    clear_bit(STATUS, RP0);
    set_bit(STATUS, RP0);
    OPTION_REG = 0x84;   /* TMR0 counts cycles, 1:32 */
    clear_bit(STATUS, RP0);
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
