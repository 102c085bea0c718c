/*
 * stream-arm: servo pulses for the PIC16F84 at 4 MHz (XC8), positions from a serial line.
 * Generated from the job by servogen: change the job, not this file.
 *
 * 0  RB0  base: 1000 to 2000 us
 * 1  RB1  shoulder: 1111 to 1889 us
 * 2  RB2  grip: 1250 to 1750 us
 *
 * 2400 baud on RA4: FF n p is position p (0 to 254) of servo n.
 * A frame takes 19968 us: 6 slots of 13 rounds of 256 cycles, which TMR0 counts. An interrupt every
 * 128 cycles looks at the line and makes the edges; the C prepares a pulse while another one lasts.
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

/*
 * Of each servo in turn, low bytes and high bytes: the width of position 0, 256ths of cycles for each position more,
 * the neutral pose; its bit among the servos, its pin.
 */
const unsigned char FACTS[] = {
    232, 87, 226, 3, 4, 4, 240, 16, 248, 3, 3, 1, 220, 220, 220, 5, 5, 5, 1, 2, 4, 1, 2, 4
};

/* Where each servo is, where it goes, by how much a frame at most (0: at once). */
unsigned char width_low[3], width_high[3], goal_low[3], goal_high[3], speed[3];

/* Servos that wait for their group, those of the group that moves, the frames that it has left. */
unsigned char waiting, group, left;
unsigned char silence;

/* Bits 0 to 5: the slot; bit 6: the group starts with the next frame; bit 7: positions wait for their group. */
unsigned char slot;

/* A servo, and what is reckoned for it. */
unsigned char n, x_lo, x_hi, sum_lo, sum_hi;

/* The pulse of the next slot. due: bit 1 asks for it, bit 2: a command came before; bit 0: a pulse was late, once. */
unsigned char next_lo, next_hi, mask, due;

/* A command that came whole; the interrupt's own. */
unsigned char todo, value;
unsigned char ticks, rest, fine, t, rx_bits, rx_left, rx_last, rx_byte, command;

void __interrupt() tick(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // Every 128 cycles: one or two looks at the line. In the rounds of 256 cycles that have an edge: the edge, and the looks around it.
    // 
    // STATUS bit 0 is the carry, bit 2 is zero. TMR0 counts cycles. A round without an edge has two interrupts: each adds 128 to TMR0, so
    // that the next one comes 128 cycles after it; after two of them TMR0 shows the time again. _ticks counts the interrupts until the
    // round with the next edge; it is odd whenever TMR0 shows the time, and even when TMR0 is 128 ahead of it. So the time is known
    // however late the interrupt came. An edge is in the cycle that st_exactly finds; all else may take any time below its limit.
    // 
    // In:  _next_lo, _next_hi, _mask   the pulse of the slot that comes: width in cycles, pin
    // Out: _due                        bit 1: prepare the next slot; it is cleared when that is done
    // bit 2: a command that is in _todo came before
    // bit 0: a slot was not prepared in time, once (overrun)
    // _todo, _value               a command's second and third byte
    asm("    bcf     INTCON, 2");   // T0IF
    asm("    movf    _rx_bits, F");
    asm("    btfsc   STATUS, 2");
    asm("    goto    st_quiet");
    asm("    call    st_take");
    asm("    decfsz  _ticks, F");
    asm("    goto    st_plain");
    asm("    goto    st_edge");
    asm("st_quiet:");
    asm("    call    st_hunt");
    asm("    decfsz  _ticks, F");
    asm("    goto    st_plain_quiet");
    asm("st_edge:");
    // An edge: looks 64 cycles apart, the last 80 before it, or one less. _ticks, kept odd, is free until it is set anew.
    asm("    movf    _rest, F");
    asm("    btfss   STATUS, 2");
    asm("    goto    st_fall");
    asm("    clrf    _fine");   // a rise; a fall is _fine cycles later in its round
    asm("    btfss   _due, 1");
    asm("    goto    st_fall");
    asm("    clrf    _mask");   // not prepared: no pulse
    asm("    bsf     _due, 0");
    asm("st_fall:");
    asm("    movlw   0x3F");
    asm("    andwf   _fine, W");
    asm("    addlw   72");
    asm("    iorlw   1");
    asm("    movwf   _ticks");
    asm("    btfss   _fine, 5");
    asm("    goto    st_before");
    asm("    goto    $+1");   // the next one is far: one more, half-way
    asm("    goto    $+1");
    asm("    call    st_look");
    asm("st_before:");
    asm("    movf    _ticks, W");
    asm("    subwf   TMR0, W");
    asm("    andlw   0xC0");   // it is time up to 63 cycles after it
    asm("    btfss   STATUS, 2");
    asm("    goto    st_before");
    asm("    call    st_look");
    asm("    movlw   64");
    asm("    addwf   _ticks, F");
    asm("    movf    _fine, W");
    asm("    subwf   _ticks, W");
    asm("    xorlw   136");
    asm("    andlw   0xFE");
    asm("    btfss   STATUS, 2");
    asm("    goto    st_before");
    asm("    movf    _fine, W");
    asm("    addlw   152");
    asm("    call    st_exactly");
    asm("    movf    _rest, F");
    asm("    movlw   0");
    asm("    btfsc   STATUS, 2");
    asm("    movf    _mask, W");
    asm("    movwf   PORTB");   // the edge
    asm("    movf    _rest, F");
    asm("    btfss   STATUS, 2");
    asm("    goto    st_fallen");
    asm("    call    st_look");
    asm("    decf    _next_hi, W");   // two interrupts per round, less one: the first one's
    asm("    addwf   _next_hi, W");
    asm("    movwf   _ticks");
    asm("    sublw   24");
    asm("    movwf   _rest");
    asm("    movf    _next_lo, W");
    asm("    movwf   _fine");
    asm("    bsf     _due, 1");
    asm("    movlw   0xFE");
    asm("    subwf   _todo, W");
    asm("    btfss   STATUS, 2");
    asm("    bsf     _due, 2");
    asm("    goto    st_out");
    // One more look, unless an interrupt that has one comes at once, or the next round has an edge.
    asm("st_fallen:");
    asm("    movf    _rest, W");
    asm("    movwf   _ticks");
    asm("    clrf    _rest");
    asm("    btfss   _fine, 7");
    asm("    goto    st_early");
    asm("    btfss   _fine, 6");
    asm("    goto    st_out");   // in the next round already, whose interrupt is pending
    asm("    bcf     INTCON, 2");   // most of the next round is over: its interrupts are this one
    asm("    movlw   2");
    asm("    subwf   _ticks, F");
    asm("    call    st_look");
    asm("    goto    st_whole_round");
    asm("st_early:");
    asm("    btfss   _fine, 6");
    asm("    goto    st_over");
    asm("    decf    _ticks, W");
    asm("    btfsc   STATUS, 2");
    asm("    goto    st_out");
    asm("st_over:");
    asm("    call    st_look");
    asm("    goto    st_out");
    // The same; then one more look for a start bit.
    asm("st_plain_quiet:");
    asm("    movlw   164");
    asm("    addwf   TMR0, W");
    asm("    btfsc   STATUS, 0");
    asm("    goto    st_late");
    asm("    movlw   131");
    asm("    addwf   TMR0, F");
    asm("    movf    _rx_bits, F");
    asm("    btfss   STATUS, 2");
    asm("    goto    st_out");   // found
    asm("    goto    $+1");
    asm("    goto    $+1");
    asm("    call    st_hunt");
    asm("    goto    st_out");
    // The round before took long: this one is not divided. One more look, if there is time for it.
    asm("st_late:");
    asm("    decf    _ticks, F");
    asm("st_whole_round:");
    asm("    movlw   72");
    asm("    addwf   TMR0, W");
    asm("    btfsc   STATUS, 0");
    asm("    goto    st_out");
    asm("st_second:");
    asm("    movlw   168");
    asm("    subwf   TMR0, W");
    asm("    btfss   STATUS, 0");
    asm("    goto    st_second");
    asm("    call    st_look");
    asm("    goto    st_out");
    // Waits for the cycle in which TMR0 is W, at least 11 from now, and returns a fixed time after it.
    asm("st_exactly:");
    asm("    movwf   _t");
    asm("st_poll:");
    asm("    movf    TMR0, W");
    asm("    subwf   _t, W");
    asm("    addlw   0xF0");
    asm("    btfsc   STATUS, 0");
    asm("    goto    st_poll");
    asm("    movwf   _t");   // it is 8 to 15 away: 0 to 7 in the lowest three bits
    asm("    btfsc   _t, 0");
    asm("    goto    $+1");
    asm("    btfsc   _t, 1");
    asm("    goto    $+1");
    asm("    btfsc   _t, 1");
    asm("    goto    $+1");
    asm("    btfss   _t, 2");
    asm("    return");
    asm("    nop");
    asm("    goto    $+1");
    asm("    return");
    // A look at the line. Time is counted in units of 4 cycles; a bit's level is that of the first look after its middle.
    asm("st_look:");
    asm("    movf    _rx_bits, F");
    asm("    btfsc   STATUS, 2");
    asm("    goto    st_hunt");
    asm("st_take:");
    asm("    movf    TMR0, W");
    asm("    btfss   _ticks, 0");
    asm("    addlw   128");
    asm("    movwf   _t");
    asm("    rrf     _t, F");
    asm("    rrf     _t, F");   // only its lowest six bits count
    asm("    btfsc   _rx_bits, 7");
    asm("    goto    st_broken");
    asm("    movf    _rx_last, W");
    asm("    subwf   _t, W");
    asm("    andlw   0x3F");
    asm("    subwf   _rx_left, F");
    asm("    movf    _t, W");
    asm("    movwf   _rx_last");
    asm("    btfsc   STATUS, 0");
    asm("    return");
    asm("    movlw   104");
    asm("    addwf   _rx_left, F");
    asm("    btfsc   _rx_bits, 6");
    asm("    goto    st_send");
    asm("    decfsz  _rx_bits, F");
    asm("    goto    st_bit");
    asm("    btfss   PORTA, 4");
    asm("    goto    st_break");   // no stop bit
    asm("    incf    _rx_byte, W");
    asm("    btfsc   STATUS, 2");
    asm("    goto    st_sync");
    asm("    incf    _command, W");
    asm("    btfsc   STATUS, 2");
    asm("    goto    st_what");
    asm("    movlw   0xFE");
    asm("    xorwf   _command, W");
    asm("    btfsc   STATUS, 2");
    asm("    return");
    asm("    xorlw   0xFE");
    asm("    movwf   _todo");
    asm("    movf    _rx_byte, W");
    asm("    movwf   _value");
    asm("    movlw   0xFE");
    asm("    movwf   _command");
    asm("    return");
    asm("st_what:");
    asm("    movf    _rx_byte, W");
    asm("    movwf   _command");
    asm("    return");
    asm("st_sync:");
    asm("    movlw   0xFF");
    asm("    movwf   _command");
    asm("    return");
    asm("st_hunt:");
    asm("    btfsc   PORTA, 4");
    asm("    return");
    asm("    movf    TMR0, W");   // a start bit begins
    asm("    btfss   _ticks, 0");
    asm("    addlw   128");
    asm("    movwf   _t");
    asm("    rrf     _t, F");
    asm("    rrf     _t, W");   // only its lowest six bits count
    asm("    movwf   _rx_last");
    asm("    movlw   15");
    asm("    movwf   _rx_left");
    asm("    movlw   10");
    asm("    movwf   _rx_bits");
    asm("    return");
    asm("st_break:");
    asm("    movlw   0xFE");
    asm("    movwf   _command");
    asm("    movlw   0x80");
    asm("    movwf   _rx_bits");
    asm("    return");
    asm("st_broken:");
    asm("    btfsc   PORTA, 4");
    asm("    clrf    _rx_bits");
    asm("    return");
    asm("st_bit:");
    asm("    btfss   _rx_bits, 3");
    asm("    goto    st_data");
    asm("    btfss   _rx_bits, 0");
    asm("    goto    st_data");
    asm("    btfsc   PORTA, 4");
    asm("    clrf    _rx_bits");   // no start bit: noise
    asm("    return");
    asm("st_data:");
    asm("    bcf     STATUS, 0");
    asm("    btfsc   PORTA, 4");
    asm("    bsf     STATUS, 0");
    asm("    rrf     _rx_byte, F");
    asm("    return");
    // An answer: _rx_bits is 0x4A before its start bit and counts to 0x40, the stop bit. The receiver is deaf so long.
    asm("st_send:");
    asm("    decf    _rx_bits, F");
    asm("    bsf     STATUS, 0");
    asm("    btfss   _rx_bits, 3");
    asm("    goto    st_shift");
    asm("    btfss   _rx_bits, 0");
    asm("    goto    st_shift");
    asm("    movwf   _rx_left");   // the start bit is a bit long, whenever it was asked for
    asm("    bcf     PORTA, 3");
    asm("    return");
    asm("st_shift:");
    asm("    rrf     _rx_byte, F");
    asm("    btfss   STATUS, 0");
    asm("    bcf     PORTA, 3");
    asm("    btfsc   STATUS, 0");
    asm("    bsf     PORTA, 3");
    asm("    movlw   0x3F");
    asm("    andwf   _rx_bits, W");
    asm("    btfsc   STATUS, 2");
    asm("    clrf    _rx_bits");
    asm("    return");
    // A round without an edge: the next interrupt comes 128 cycles after this one.
    asm("st_plain:");
    asm("    movlw   164");
    asm("    addwf   TMR0, W");
    asm("    btfsc   STATUS, 0");
    asm("    goto    st_late");   // only after an edge
    asm("    movlw   131");   // 128, and the three cycles that TMR0 stands still (DS35007 figure 5-2)
    asm("    addwf   TMR0, F");
    asm("st_out:");
}

void extend(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // The trim that the byte _x_lo is, as cycles in _x_hi, _x_lo; the erased byte is none.
    asm("    clrf    _x_hi");
    asm("    incf    _x_lo, W");
    asm("    btfsc   STATUS, 2");
    asm("    clrf    _x_lo");
    asm("    btfsc   _x_lo, 7");
    asm("    decf    _x_hi, F");
}

/* The trim of servo n: x. */
void read_trim(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // Byte _n of the data EEPROM (DS35007 section 3.1) to _x_lo.
    asm("    movf    _n, W");
    asm("    movwf   EEADR");
    asm("    bsf     STATUS, 5");   // bank 1
    asm("    bsf     0x08, 0");   // EECON1, RD
    asm("    bcf     STATUS, 5");
    asm("    movf    EEDATA, W");
    asm("    movwf   _x_lo");
    extend();
}

void keep_trim(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // Begins to write _value to byte _n of the data EEPROM (DS35007 section 3.2); it takes about 10 ms.
    asm("    movf    _n, W");
    asm("    movwf   EEADR");
    asm("    movf    _value, W");
    asm("    movwf   EEDATA");
    asm("    bsf     STATUS, 5");   // bank 1
    asm("    bsf     0x08, 2");   // EECON1, WREN
    asm("    bcf     INTCON, 7");   // GIE; an interrupt that came with it would have set it again
    asm("    btfsc   INTCON, 7");
    asm("    goto    $-2");
    asm("    movlw   0x55");
    asm("    movwf   0x09");   // EECON2
    asm("    movlw   0xAA");
    asm("    movwf   0x09");
    asm("    bsf     0x08, 1");   // WR
    asm("    bsf     INTCON, 7");
    asm("    bcf     0x08, 2");
    asm("    bcf     STATUS, 5");
}

void ready(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // _x_lo: 0 when no byte of the EEPROM is being written.
    asm("    bsf     STATUS, 5");   // bank 1
    asm("    movf    0x08, W");   // EECON1
    asm("    bcf     STATUS, 5");
    asm("    andlw   0x02");   // WR
    asm("    movwf   _x_lo");
    asm("    clrwdt");   // a watchdog that was left on is fed as long as main goes round
}

void multiply(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // _sum_hi, _sum_lo = (_value * _x + 128) / 256; _value is used up.
    asm("    movlw   128");
    asm("    movwf   _sum_lo");
    asm("    clrf    _sum_hi");
    asm("    movlw   8");
    asm("    movwf   FSR");
    asm("st_multiply:");
    asm("    rrf     _value, F");
    asm("    btfss   STATUS, 0");
    asm("    goto    st_halve");
    asm("    movf    _x_lo, W");
    asm("    addwf   _sum_lo, F");
    asm("    btfsc   STATUS, 0");
    asm("    incf    _sum_hi, F");
    asm("    movf    _x_hi, W");
    asm("    addwf   _sum_hi, F");   // no carry: the scale is below half of 16 bits
    asm("st_halve:");
    asm("    rrf     _sum_hi, F");
    asm("    rrf     _sum_lo, F");
    asm("    decfsz  FSR, F");
    asm("    goto    st_multiply");
}

void add(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // _sum += _x
    asm("    movf    _x_lo, W");
    asm("    addwf   _sum_lo, F");
    asm("    btfsc   STATUS, 0");
    asm("    incf    _sum_hi, F");
    asm("    movf    _x_hi, W");
    asm("    addwf   _sum_hi, F");
}

/* What lies between a servo's width (next) and its goal (x). */
void way(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // The way from _next to _x: its length in _x_hi, _x_lo; _sum_hi is 0xFF where it goes down, else 0.
    asm("    clrf    _sum_hi");
    asm("    movf    _next_lo, W");
    asm("    subwf   _x_lo, F");
    asm("    movf    _next_hi, W");
    asm("    btfss   STATUS, 0");
    asm("    incfsz  _next_hi, W");
    asm("    subwf   _x_hi, F");
    asm("    btfsc   STATUS, 0");
    asm("    goto    st_up");
    asm("    decf    _sum_hi, F");
    asm("    comf    _x_lo, F");
    asm("    comf    _x_hi, F");
    asm("    incf    _x_lo, F");
    asm("    btfsc   STATUS, 2");
    asm("    incf    _x_hi, F");
    asm("st_up:");
}

void step(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // _next goes on by _x, down where _sum_hi is not 0.
    asm("    movf    _sum_hi, F");
    asm("    btfss   STATUS, 2");
    asm("    goto    st_down");
    asm("    movf    _x_lo, W");
    asm("    addwf   _next_lo, F");
    asm("    btfsc   STATUS, 0");
    asm("    incf    _next_hi, F");
    asm("    movf    _x_hi, W");
    asm("    addwf   _next_hi, F");
    asm("    goto    st_gone");
    asm("st_down:");
    asm("    movf    _x_lo, W");
    asm("    subwf   _next_lo, F");
    asm("    btfss   STATUS, 0");
    asm("    decf    _next_hi, F");
    asm("    movf    _x_hi, W");
    asm("    subwf   _next_hi, F");
    asm("st_gone:");
}

void divide(void)
{
    asm("bcf STATUS, 5");   // bank 0: the compiler may have left the other one selected
    // _x_hi, _x_lo = _x / _left, rounded down; _left is not 0.
    asm("    movf    _x_hi, W");
    asm("    movwf   _sum_lo");   // the remainder
    asm("    clrf    _x_hi");
    asm("st_whole:");
    asm("    movf    _left, W");
    asm("    subwf   _sum_lo, W");
    asm("    btfss   STATUS, 0");
    asm("    goto    st_parts");
    asm("    movwf   _sum_lo");
    asm("    incf    _x_hi, F");
    asm("    goto    st_whole");
    asm("st_parts:");
    asm("    movlw   8");
    asm("    movwf   FSR");
    asm("st_part:");
    asm("    rlf     _x_lo, F");
    asm("    rlf     _sum_lo, F");
    asm("    movf    _left, W");
    asm("    btfsc   STATUS, 0");
    asm("    goto    st_fits");
    asm("    subwf   _sum_lo, W");
    asm("    btfsc   STATUS, 0");
    asm("    movwf   _sum_lo");
    asm("    goto    st_digit");
    asm("st_fits:");
    asm("    subwf   _sum_lo, F");
    asm("    bsf     STATUS, 0");
    asm("st_digit:");
    asm("    decfsz  FSR, F");
    asm("    goto    st_part");
    asm("    rlf     _x_lo, F");
}

/* sum and the trim are servo n's goal; a servo without pulses is there at once. */
void go(void)
{
    read_trim();
    add();
    goal_low[n] = sum_lo;
    goal_high[n] = sum_hi;
    if (width_high[n] == 0) {
        width_low[n] = sum_lo;
        width_high[n] = sum_hi;
    }
}

/* Two facts of servo n, from the row in x_lo on. */
void look_up(void)
{
    x_lo += n;
    x_hi = FACTS[x_lo + 3];
    x_lo = FACTS[x_lo];
}

void go_neutral(void)
{
    x_lo = 12;
    look_up();
    sum_lo = x_lo;
    sum_hi = x_hi;
    go();
}

/* A command of the line: servo n goes to position value. */
void position(void)
{
    x_lo = 6;
    look_up();
    multiply();
    x_lo = 0;
    look_up();
    add();
    go();
    x_lo = 18;
    look_up();
    sum_lo = x_lo;
    waiting |= sum_lo;
    if (!(slot & 0x80))
        waiting ^= sum_lo;
    group |= sum_lo;
    group ^= sum_lo;   /* it goes alone */
}

/* The pulses move by as much as the trim does. */
void set_trim(void)
{
    read_trim();
    sum_lo = x_lo;
    sum_hi = x_hi;
    value -= 127;
    keep_trim();
    x_lo = value;
    extend();
    x_hi -= sum_hi;
    if (x_lo < sum_lo)
        x_hi--;
    x_lo -= sum_lo;
    sum_lo = goal_low[n];
    sum_hi = goal_high[n];
    if (sum_hi == 0)
        return;
    add();
    goal_low[n] = sum_lo;
    goal_high[n] = sum_hi;
    sum_lo = width_low[n];
    sum_hi = width_high[n];
    add();
    width_low[n] = sum_lo;
    width_high[n] = sum_hi;
}

/* The high byte of servo n's width, or the low one; the interrupt sends it. Nothing drives the line before. */
void answer(void)
{
    PORTA = 0x08;
    TRISA = 0x17;
    n = value & 0x07;
    if (n >= 3)
        n = 0;
    rx_byte = width_high[n];
    if (value & 0x08)
        rx_byte = width_low[n];
    rx_left = 0;
    rx_bits = 0x4A;
}

/* What the command says. */
void execute(void)
{
    n = todo & 0x07;
    sum_lo = todo & 0xF8;
    todo = 0xFE;
    if (sum_lo == 0x80) {
        if (n != 0)
            return;
        if (value == 0)
            slot |= 0x80;
        else {
            slot &= 0x3F;
            slot |= 0x40;
            group = waiting;
            waiting = 0;
            left = value;
        }
    } else {
        if (n >= 3)
            return;
        if (sum_lo == 0x00)
            position();
        else if (sum_lo == 0x40)
            speed[n] = value;
        else if (sum_lo == 0xC0)
            set_trim();
        else if (sum_lo == 0xF0 && n == 0)
            answer();
        else
            return;
    }
    silence = 0;
}

/* The groups' and the fail-safe's clock. */
void begin_frame(void)
{
    if (slot & 0x40)
        slot &= 0xBF;
    else if (left != 0) {
        left--;
        if (left == 0)
            group = 0;
    }
    if (silence < 51) {
        silence++;
        if (silence == 50) {
            group = 0x07;
            waiting = 0;
            slot = 0x40;
            left = 50;
        }
    }
}

/* The pulse of the next slot. */
void prepare(void)
{
    slot++;
    n = slot & 0x3F;
    if (n == 6) {
        n = 0;
        slot &= 0xC0;
        begin_frame();
    }
    if (n >= 3) {
        mask = 0;
        next_hi = 1;
        return;
    }
    mask = FACTS[n + 18];
    if (silence == 50 && (group & mask))
        go_neutral();
    x_lo = goal_low[n];
    x_hi = goal_high[n];
    next_lo = width_low[n];
    next_hi = width_high[n];
    way();
    if (waiting & mask)
        x_lo = x_hi = 0;
    else if (group & mask) {
        if (slot & 0x40)
            x_lo = x_hi = 0;
        else
            divide();
    } else {
        sum_lo = speed[n];
        if (sum_lo != 0 && (x_hi != 0 || x_lo > sum_lo)) {
            x_lo = sum_lo;
            x_hi = 0;
        }
    }
    step();
    width_low[n] = next_lo;
    width_high[n] = next_hi;
    if (next_hi == 0) {
        mask = 0;
        next_hi = 1;
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xF8;
    OPTION_REG = 0x8F;   /* TMR0 counts cycles; the watchdog, if it is on, 128 times its time */
    TMR0 = 0;   /* unknown at power-up */
    n = 3;
    while (n != 0) {
        n--;
        speed[n] = 0;
        width_high[n] = 0;
        go_neutral();
    }
    waiting = 0;
    group = 0;
    left = 0;
    silence = 0;
    todo = 0xFE;
    command = 0xFE;
    rx_bits = 0;
    rest = 0;
    slot = 5;
    prepare();
    due = 0;
    ticks = 3;
    INTCON = 0xA0;
    while (1) {
        ready();
        if (due & 2) {
            prepare();
            sum_lo = due;
            due &= 1;   /* one instruction: the interrupt's bit stays */
            ready();
            if ((sum_lo & 4) && x_lo == 0)
                execute();
        }
    }
}
