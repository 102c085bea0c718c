/*
 * rvm1-program: servo pulses for the PIC16F84 at 4 MHz (C2C).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  waist: 1417 to 1665 us
 * RB1  shoulder: 1250 to 1500 us
 * RB2  elbow: 1344 to 1834 us
 * RB3  pitch: 1333 to 1611 us
 * RB4  roll: 1501 us
 * RB5  hand: 1361 to 1555 us
 *
 * A frame takes 20000 us: 5 slots, each begun by TMR0, which counts 32 us and is never
 * written. The C between the slots may take any time that ends before the next one begins.
 *
 * What the motion does, part by part: its end, and the servos for it.
 *   line 210, 0 to 1.18 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 220, 1.18 to 1.36 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 230, 1.36 to 1.66 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 240, 1.66 to 1.84 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 260, 1.84 to 2.34 s:
 *     tool 0, 300, 300 mm; waist 90 deg: 1500 us; shoulder 89.6 deg: 1498 us; elbow 65.1 deg: 1362 us; pitch
 *     100.3 deg: 1557 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 270, 2.34 to 2.52 s:
 *     tool 0, 300, 260 mm; waist 90 deg: 1500 us; shoulder 83.1 deg: 1462 us; elbow 62.1 deg: 1345 us; pitch
 *     109.8 deg: 1610 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 280, 2.52 to 2.82 s:
 *     tool 0, 300, 260 mm; waist 90 deg: 1500 us; shoulder 83.1 deg: 1462 us; elbow 62.1 deg: 1345 us; pitch
 *     109.8 deg: 1610 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 290, 2.82 to 2.98 s:
 *     tool 0, 300, 300 mm; waist 90 deg: 1500 us; shoulder 89.6 deg: 1498 us; elbow 65.1 deg: 1362 us; pitch
 *     100.3 deg: 1557 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 210, 2.98 to 3.48 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 220, 3.48 to 3.66 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 230, 3.66 to 3.96 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 240, 3.96 to 4.14 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 260, 4.14 to 4.88 s:
 *     tool 80, 300, 300 mm; waist 75.1 deg: 1417 us; shoulder 87.7 deg: 1487 us; elbow 69.7 deg: 1387 us;
 *     pitch 97.6 deg: 1542 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 270, 4.88 to 5.06 s:
 *     tool 80, 300, 260 mm; waist 75.1 deg: 1417 us; shoulder 81.5 deg: 1453 us; elbow 66.7 deg: 1371 us;
 *     pitch 106.8 deg: 1593 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 280, 5.06 to 5.36 s:
 *     tool 80, 300, 260 mm; waist 75.1 deg: 1417 us; shoulder 81.5 deg: 1453 us; elbow 66.7 deg: 1371 us;
 *     pitch 106.8 deg: 1593 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 290, 5.36 to 5.52 s:
 *     tool 80, 300, 300 mm; waist 75.1 deg: 1417 us; shoulder 87.7 deg: 1487 us; elbow 69.7 deg: 1387 us;
 *     pitch 97.6 deg: 1542 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 210, 5.52 to 6.26 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 220, 6.26 to 6.44 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 230, 6.44 to 6.74 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 240, 6.74 to 6.92 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 260, 6.92 to 7.42 s:
 *     tool 0, 370, 300 mm; waist 90 deg: 1500 us; shoulder 74.3 deg: 1413 us; elbow 102.4 deg: 1569 us; pitch
 *     78.3 deg: 1435 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 270, 7.42 to 7.58 s:
 *     tool 0, 370, 260 mm; waist 90 deg: 1500 us; shoulder 69.6 deg: 1387 us; elbow 98.5 deg: 1547 us; pitch
 *     86.8 deg: 1482 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 280, 7.58 to 7.88 s:
 *     tool 0, 370, 260 mm; waist 90 deg: 1500 us; shoulder 69.6 deg: 1387 us; elbow 98.5 deg: 1547 us; pitch
 *     86.8 deg: 1482 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 290, 7.88 to 8.04 s:
 *     tool 0, 370, 300 mm; waist 90 deg: 1500 us; shoulder 74.3 deg: 1413 us; elbow 102.4 deg: 1569 us; pitch
 *     78.3 deg: 1435 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 210, 8.04 to 8.54 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 220, 8.54 to 8.72 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 230, 8.72 to 9.02 s:
 *     tool -160, 280, 280 mm; waist 119.7 deg: 1665 us; shoulder 82.6 deg: 1459 us; elbow 73.4 deg: 1408 us;
 *     pitch 98.9 deg: 1550 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 240, 9.02 to 9.2 s:
 *     tool -160, 280, 320 mm; waist 119.7 deg: 1665 us; shoulder 88 deg: 1489 us; elbow 77.7 deg: 1432 us;
 *     pitch 89.3 deg: 1496 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 260, 9.2 to 9.88 s:
 *     tool 80, 370, 300 mm; waist 77.8 deg: 1432 us; shoulder 71.6 deg: 1398 us; elbow 109 deg: 1606 us; pitch
 *     74.4 deg: 1413 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 270, 9.88 to 10.04 s:
 *     tool 80, 370, 260 mm; waist 77.8 deg: 1432 us; shoulder 67.3 deg: 1374 us; elbow 104.7 deg: 1581 us;
 *     pitch 83.1 deg: 1462 us; roll 90 deg: 1500 us
 *     hand 110 deg: 1556 us
 *   line 280, 10.04 to 10.34 s:
 *     tool 80, 370, 260 mm; waist 77.8 deg: 1432 us; shoulder 67.3 deg: 1374 us; elbow 104.7 deg: 1581 us;
 *     pitch 83.1 deg: 1462 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 290, 10.34 to 10.5 s:
 *     tool 80, 370, 300 mm; waist 77.8 deg: 1432 us; shoulder 71.6 deg: 1398 us; elbow 109 deg: 1606 us; pitch
 *     74.4 deg: 1413 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 *   line 120, 10.5 to 11.18 s:
 *     tool 0, 410, 228 mm; waist 90 deg: 1500 us; shoulder 45 deg: 1250 us; elbow 150 deg: 1833 us; pitch 60
 *     deg: 1333 us; roll 90 deg: 1500 us
 *     hand 40 deg: 1361 us
 */
#pragma CLOCK_FREQ 4000000
/* XT, watchdog off, power-up timer on, no code protection: */
asm __config 0x3FF1

#define CHANNELS 6
#define SLOTS 5
#define HALF 128   /* of a 256th of a step: times are rounded to the nearest */

/* Poses, 6 bytes each, in steps of 2 us from each channel's base width. */
const unsigned char ROW[] = {
    44, 127, 80, 86, 3, 72,   /* 0 */
    44, 2, 247, 2, 3, 2,   /* 6 */
    47, 6, 239, 5, 3, 2,   /* 12 */
    53, 15, 225, 11, 3, 2,   /* 18 */
    117, 108, 68, 75, 3, 2,   /* 24 */
    123, 117, 53, 81, 3, 2,   /* 30 */
    126, 121, 46, 83, 3, 2,   /* 36 */
    126, 106, 34, 110, 3, 2,   /* 42 */
    126, 106, 34, 110, 3, 99,   /* 48 */
    126, 121, 46, 84, 3, 99,   /* 54 */
    44, 126, 11, 114, 3, 99,   /* 60 */
    44, 108, 2, 141, 3, 99,   /* 66 */
    44, 108, 2, 141, 3, 2,   /* 72 */
    44, 126, 11, 114, 3, 2,   /* 78 */
    2, 121, 24, 107, 3, 99,   /* 84 */
    2, 103, 15, 132, 3, 99,   /* 90 */
    2, 103, 15, 132, 3, 2,   /* 96 */
    2, 121, 24, 107, 3, 2,   /* 102 */
    44, 83, 115, 53, 3, 99,   /* 108 */
    44, 83, 114, 54, 3, 99,   /* 114 */
    44, 71, 104, 76, 3, 99,   /* 120 */
    44, 70, 104, 77, 3, 2,   /* 126 */
    44, 83, 115, 53, 3, 2,   /* 132 */
    10, 76, 133, 42, 3, 99,   /* 138 */
    10, 75, 132, 43, 3, 99,   /* 144 */
    10, 66, 122, 63, 3, 99,   /* 150 */
    10, 64, 121, 66, 3, 99,   /* 156 */
    10, 64, 121, 66, 3, 2,   /* 162 */
    10, 76, 133, 42, 3, 2   /* 168 */
};
#define COLUMNS 6   /* bytes of a pose */

/* Steps from pose to pose, each to the next row: its timing. Before a step there may be: */
#define TO_ROW 252   /* it goes to the row at the next byte */
#define SCRIPT_END 73
#define SCRIPT_LOOP 7   /* where it goes on after its end */
const unsigned char SCRIPT[] = {
    252, 0, 0, 252, 0, 1, 0, 252, 6, 2, 3, 3, 4, 3, 3, 252, 36, 5, 6, 7, 6, 8, 6, 7, 9, 252,
    36, 8, 6, 7, 6, 252, 84, 10, 6, 7, 9, 252, 36, 10, 6, 7, 6, 252, 108, 8, 11, 12, 252, 120,
    2, 7, 9, 252, 36, 8, 6, 7, 6, 252, 138, 13, 11, 3, 14, 7, 9, 252, 6, 13, 252, 6, 2
};

/* All else that is constant, in one table, and where its parts begin. */
#define BASE_LOW 0   /* the channels' base widths */
#define BASE_HIGH 6
#define SLOT_A 12   /* the pins that rise together in a slot */
#define SLOT_TICKS 17   /* ticks from the slot before */
#define SLOT_CHANNEL 22   /* the channel of pin A */
#define FRAMES 27   /* of a step; 0 is 256 */
#define SPEED_LOW 42   /* 65536ths of a step in a frame */
#define SPEED_HIGH 57
#define TIMING_LAW 89   /* where its law begins; 255: straight, 254: at once, 252: no pulses */
const unsigned char CONSTANT[] = {
    133, 222, 60, 49, 215, 77,   /* BASE_LOW */
    5, 4, 5, 5, 5, 5,   /* BASE_HIGH */
    0x01, 0x04, 0x10, 0x00, 0x00,   /* SLOT_A */
    188, 80, 84, 76, 197,   /* SLOT_TICKS */
    0, 2, 4, 0, 0,   /* SLOT_CHANNEL */
    50, 50, 1, 5, 35, 2, 9, 15, 25, 8, 37, 1, 6, 34, 2,   /* FRAMES */
    31, 31, 0, 51, 80, 0, 114, 17, 61, 0, 235, 0, 171, 136, 0,   /* SPEED_LOW */
    5, 5, 0, 51, 7, 128, 28, 17, 10, 32, 6, 0, 42, 7, 128,   /* SPEED_HIGH */
    0, 3, 11, 24, 43, 65, 86, 107, 129, 150, 171, 192, 214, 233, 246, 254, 255,   /* laws: weights at each sixteenth of a step */
    255, 254, 254, 255, 255, 254, 72, 255, 72, 72, 72, 255, 255, 72, 255   /* TIMING_LAW */
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
    asm {
; key * 256 + (next - key) * weight: 16 bits.
; In: _key, _next, _weight, _sign (bit 0 clear). Out: _value, whole, and _value_low, the fraction.
    movf    _key, W
    subwf   _next, W
    btfsc   STATUS, 0
    goto    pl_rising
    sublw   0                   ; key - next
    bsf     _sign, 0
pl_rising:
    movwf   _value_high
    movf    _weight, W
    movwf   _value_low
    clrf    _value
    movlw   8
    movwf   _count
    movf    _value_high, W
    rrf     _value_low, F
pl_between:
    btfsc   STATUS, 0
    addwf   _value, F
    rrf     _value, F
    rrf     _value_low, F
    decfsz  _count, F
    goto    pl_between
    btfss   _sign, 0
    goto    pl_sum
    comf    _value, F
    comf    _value_low, F
    incf    _value_low, F
    btfsc   STATUS, 2
    incf    _value, F
pl_sum:
    movf    _key, W
    addwf   _value, F
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
    asm {
; The width of a channel: base + value * steps + trim, in cycles.
; In: _value, whole, and _value_low, the fraction; _key, _next: the base's bytes; _channel. Out: _key, _next.
    clrf    _value_high
    bcf     STATUS, 0           ; twice
    rlf     _value_low, F
    rlf     _value, F
    rlf     _value_high, F
    movf    _value_high, W
    addwf   _key, F
    movf    _value, W
    addwf   _next, F
    btfsc   STATUS, 0
    incf    _key, F
; The trim is the channel's byte of the data EEPROM (DS35007 section 3.1), in two's complement; 0xFF: none.
    movf    _channel, W
    movwf   EEADR
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 0             ; EECON1, RD
    bcf     STATUS, 5
    incf    EEDATA, W
    btfsc   STATUS, 2
    goto    pl_width
    movf    EEDATA, W
    addwf   _next, F
    btfsc   STATUS, 0
    incf    _key, F
    btfsc   EEDATA, 7
    decf    _key, F
pl_width:
    }
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
    set_bit(STATUS, RP0);
    TRISB = 0xC0;
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
