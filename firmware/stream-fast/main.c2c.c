/*
 * stream-fast: servo pulses for the PIC16F84A at 20 MHz (C2C), positions from a serial line.
 * Generated from the job by servogen: change the job, not this file.
 *
 * 0  RB0  s0: 1000 to 2000 us
 * 1  RB1  s1: 1000 to 2000 us
 * 2  RB2  s2: 1000 to 2000 us
 * 3  RB3  s3: 1000 to 2000 us
 * 4  RB4  s4: 1000 to 2000 us
 * 5  RB5  s5: 1000 to 2000 us
 *
 * 9600 baud on RA4: FF n p is position p (0 to 254) of servo n.
 * A frame takes 19814.4 us: 9 slots of 43 rounds of 256 cycles, which TMR0 counts. An interrupt every
 * 128 cycles looks at the line and makes the edges; the C prepares a pulse while another one lasts.
 */
#pragma CLOCK_FREQ 20000000
/* HS, watchdog off, power-up timer on, no code protection: */
asm __config 0x3FF2

/*
 * Of each servo in turn, low bytes and high bytes: the width of position 0, 256ths of cycles for each position more,
 * the neutral pose; its bit among the servos, its pin.
 */
const unsigned char FACTS[] = {
    136, 136, 136, 136, 136, 136, 19, 19, 19, 19, 19, 19, 175, 175, 175, 175, 175, 175, 19,
    19, 19, 19, 19, 19, 76, 76, 76, 76, 76, 76, 29, 29, 29, 29, 29, 29, 1, 2, 4, 8, 16, 32, 1,
    2, 4, 8, 16, 32
};

/* Where each servo is, where it goes, by how much a frame at most (0: at once). */
unsigned char width_low[6], width_high[6], goal_low[6], goal_high[6], speed[6];

/* Servos that wait for their group, those of the group that moves, the frames that it has left. */
unsigned char waiting, group, left;

/* Bits 0 to 5: the slot; bit 6: the group starts with the next frame; bit 7: positions wait for their group. */
unsigned char slot;

/* A servo, and what is reckoned for it. */
unsigned char n, x_lo, x_hi, sum_lo, sum_hi;

/* The pulse of the next slot. due: bit 1 asks for it, bit 2: a command came before; bit 0: a pulse was late, once. */
unsigned char next_lo, next_hi, mask, due;

/* A command that came whole; the interrupt's own. */
unsigned char todo, value;
unsigned char ticks, rest, fine, t, rx_bits, rx_left, rx_last, rx_byte, command;

void interrupt(void)
{
    asm {
; Every 128 cycles: one or two looks at the line. In the rounds of 256 cycles that have an edge: the edge, and the looks around it.

; STATUS bit 0 is the carry, bit 2 is zero. TMR0 counts cycles. A round without an edge has two interrupts: each adds 128 to TMR0, so
; that the next one comes 128 cycles after it; after two of them TMR0 shows the time again. _ticks counts the interrupts until the
; round with the next edge; it is odd whenever TMR0 shows the time, and even when TMR0 is 128 ahead of it. So the time is known
; however late the interrupt came. An edge is in the cycle that st_exactly finds; all else may take any time below its limit.

; In:  _next_lo, _next_hi, _mask   the pulse of the slot that comes: width in cycles, pin
; Out: _due                        bit 1: prepare the next slot; it is cleared when that is done
; bit 2: a command that is in _todo came before
; bit 0: a slot was not prepared in time, once (overrun)
; _todo, _value               a command's second and third byte
    bcf     INTCON, 2           ; T0IF
    movf    _rx_bits, F
    btfsc   STATUS, 2
    goto    st_quiet
    call    st_take
    decfsz  _ticks, F
    goto    st_plain
    goto    st_edge
st_quiet:
    call    st_hunt
    decfsz  _ticks, F
    goto    st_plain_quiet
st_edge:
; An edge: looks 64 cycles apart, the last 80 before it, or one less. _ticks, kept odd, is free until it is set anew.
    movf    _rest, F
    btfss   STATUS, 2
    goto    st_fall
    clrf    _fine               ; a rise; a fall is _fine cycles later in its round
    btfss   _due, 1
    goto    st_fall
    clrf    _mask               ; not prepared: no pulse
    bsf     _due, 0
st_fall:
    movlw   0x3F
    andwf   _fine, W
    addlw   72
    iorlw   1
    movwf   _ticks
    btfss   _fine, 5
    goto    st_before
    goto    $+1                 ; the next one is far: one more, half-way
    goto    $+1
    call    st_look
st_before:
    movf    _ticks, W
    subwf   TMR0, W
    andlw   0xC0                ; it is time up to 63 cycles after it
    btfss   STATUS, 2
    goto    st_before
    call    st_look
    movlw   64
    addwf   _ticks, F
    movf    _fine, W
    subwf   _ticks, W
    xorlw   136
    andlw   0xFE
    btfss   STATUS, 2
    goto    st_before
    movf    _fine, W
    addlw   152
    call    st_exactly
    movf    _rest, F
    movlw   0
    btfsc   STATUS, 2
    movf    _mask, W
    movwf   PORTB               ; the edge
    movf    _rest, F
    btfss   STATUS, 2
    goto    st_fallen
    call    st_look
    decf    _next_hi, W         ; two interrupts per round, less one: the first one's
    addwf   _next_hi, W
    movwf   _ticks
    sublw   84
    movwf   _rest
    movf    _next_lo, W
    movwf   _fine
    bsf     _due, 1
    movlw   0xFE
    subwf   _todo, W
    btfss   STATUS, 2
    bsf     _due, 2
    goto    st_out
; One more look, unless an interrupt that has one comes at once, or the next round has an edge.
st_fallen:
    movf    _rest, W
    movwf   _ticks
    clrf    _rest
    btfss   _fine, 7
    goto    st_early
    btfss   _fine, 6
    goto    st_out              ; in the next round already, whose interrupt is pending
    bcf     INTCON, 2           ; most of the next round is over: its interrupts are this one
    movlw   2
    subwf   _ticks, F
    call    st_look
    goto    st_whole_round
st_early:
    btfss   _fine, 6
    goto    st_over
    decf    _ticks, W
    btfsc   STATUS, 2
    goto    st_out
st_over:
    call    st_look
    goto    st_out
; The same; then one more look for a start bit.
st_plain_quiet:
    movlw   164
    addwf   TMR0, W
    btfsc   STATUS, 0
    goto    st_late
    movlw   131
    addwf   TMR0, F
    movf    _rx_bits, F
    btfss   STATUS, 2
    goto    st_out              ; found
    goto    $+1
    goto    $+1
    call    st_hunt
    goto    st_out
; The round before took long: this one is not divided. One more look, if there is time for it.
st_late:
    decf    _ticks, F
st_whole_round:
    movlw   72
    addwf   TMR0, W
    btfsc   STATUS, 0
    goto    st_out
st_second:
    movlw   168
    subwf   TMR0, W
    btfss   STATUS, 0
    goto    st_second
    call    st_look
    goto    st_out
; Waits for the cycle in which TMR0 is W, at least 11 from now, and returns a fixed time after it.
st_exactly:
    movwf   _t
st_poll:
    movf    TMR0, W
    subwf   _t, W
    addlw   0xF0
    btfsc   STATUS, 0
    goto    st_poll
    movwf   _t                  ; it is 8 to 15 away: 0 to 7 in the lowest three bits
    btfsc   _t, 0
    goto    $+1
    btfsc   _t, 1
    goto    $+1
    btfsc   _t, 1
    goto    $+1
    btfss   _t, 2
    return
    nop
    goto    $+1
    return
; A look at the line. Time is counted in units of 4 cycles; a bit's level is that of the first look after its middle.
st_look:
    movf    _rx_bits, F
    btfsc   STATUS, 2
    goto    st_hunt
st_take:
    movf    TMR0, W
    btfss   _ticks, 0
    addlw   128
    movwf   _t
    rrf     _t, F
    rrf     _t, F             ; only its lowest six bits count
    btfsc   _rx_bits, 7
    goto    st_broken
    movf    _rx_last, W
    subwf   _t, W
    andlw   0x3F
    subwf   _rx_left, F
    movf    _t, W
    movwf   _rx_last
    btfsc   STATUS, 0
    return
    movlw   130
    addwf   _rx_left, F
    decfsz  _rx_bits, F
    goto    st_bit
    btfss   PORTA, 4
    goto    st_break            ; no stop bit
    incf    _rx_byte, W
    btfsc   STATUS, 2
    goto    st_sync
    incf    _command, W
    btfsc   STATUS, 2
    goto    st_what
    movlw   0xFE
    xorwf   _command, W
    btfsc   STATUS, 2
    return
    xorlw   0xFE
    movwf   _todo
    movf    _rx_byte, W
    movwf   _value
    movlw   0xFE
    movwf   _command
    return
st_what:
    movf    _rx_byte, W
    movwf   _command
    return
st_sync:
    movlw   0xFF
    movwf   _command
    return
st_hunt:
    btfsc   PORTA, 4
    return
    movf    TMR0, W             ; a start bit begins
    btfss   _ticks, 0
    addlw   128
    movwf   _t
    rrf     _t, F
    rrf     _t, W             ; only its lowest six bits count
    movwf   _rx_last
    movlw   28
    movwf   _rx_left
    movlw   10
    movwf   _rx_bits
    return
st_break:
    movlw   0xFE
    movwf   _command
    movlw   0x80
    movwf   _rx_bits
    return
st_broken:
    btfsc   PORTA, 4
    clrf    _rx_bits
    return
st_bit:
    btfss   _rx_bits, 3
    goto    st_data
    btfss   _rx_bits, 0
    goto    st_data
    btfsc   PORTA, 4
    clrf    _rx_bits            ; no start bit: noise
    return
st_data:
    bcf     STATUS, 0
    btfsc   PORTA, 4
    bsf     STATUS, 0
    rrf     _rx_byte, F
    return
; A round without an edge: the next interrupt comes 128 cycles after this one.
st_plain:
    movlw   164
    addwf   TMR0, W
    btfsc   STATUS, 0
    goto    st_late             ; only after an edge
    movlw   131                 ; 128, and the three cycles that TMR0 stands still (DS35007 figure 5-2)
    addwf   TMR0, F
st_out:
    }
}

void extend(void)
{
    asm {
; The trim that the byte _x_lo is, as cycles in _x_hi, _x_lo; the erased byte is none.
    clrf    _x_hi
    incf    _x_lo, W
    btfsc   STATUS, 2
    clrf    _x_lo
    btfsc   _x_lo, 7
    decf    _x_hi, F
    }
}

/* The trim of servo n: x. */
void read_trim(void)
{
    asm {
; Byte _n of the data EEPROM (DS35007 section 3.1) to _x_lo.
    movf    _n, W
    movwf   EEADR
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 0             ; EECON1, RD
    bcf     STATUS, 5
    movf    EEDATA, W
    movwf   _x_lo
    }
    extend();
}

void keep_trim(void)
{
    asm {
; Begins to write _value to byte _n of the data EEPROM (DS35007 section 3.2); it takes about 10 ms.
    movf    _n, W
    movwf   EEADR
    movf    _value, W
    movwf   EEDATA
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 2             ; EECON1, WREN
    bcf     INTCON, 7           ; GIE; an interrupt that came with it would have set it again
    btfsc   INTCON, 7
    goto    $-2
    movlw   0x55
    movwf   0x09                ; EECON2
    movlw   0xAA
    movwf   0x09
    bsf     0x08, 1             ; WR
    bsf     INTCON, 7
    bcf     0x08, 2
    bcf     STATUS, 5
    }
}

void ready(void)
{
    asm {
; _x_lo: 0 when no byte of the EEPROM is being written.
    bsf     STATUS, 5           ; bank 1
    movf    0x08, W             ; EECON1
    bcf     STATUS, 5
    andlw   0x02                ; WR
    movwf   _x_lo
    clrwdt                      ; a watchdog that was left on is fed as long as main goes round
    }
}

void multiply(void)
{
    asm {
; _sum_hi, _sum_lo = (_value * _x + 128) / 256; _value is used up.
    movlw   128
    movwf   _sum_lo
    clrf    _sum_hi
    movlw   8
    movwf   FSR
st_multiply:
    rrf     _value, F
    btfss   STATUS, 0
    goto    st_halve
    movf    _x_lo, W
    addwf   _sum_lo, F
    btfsc   STATUS, 0
    incf    _sum_hi, F
    movf    _x_hi, W
    addwf   _sum_hi, F          ; no carry: the scale is below half of 16 bits
st_halve:
    rrf     _sum_hi, F
    rrf     _sum_lo, F
    decfsz  FSR, F
    goto    st_multiply
    }
}

void add(void)
{
    asm {
; _sum += _x
    movf    _x_lo, W
    addwf   _sum_lo, F
    btfsc   STATUS, 0
    incf    _sum_hi, F
    movf    _x_hi, W
    addwf   _sum_hi, F
    }
}

/* What lies between a servo's width (next) and its goal (x). */
void way(void)
{
    asm {
; The way from _next to _x: its length in _x_hi, _x_lo; _sum_hi is 0xFF where it goes down, else 0.
    clrf    _sum_hi
    movf    _next_lo, W
    subwf   _x_lo, F
    movf    _next_hi, W
    btfss   STATUS, 0
    incfsz  _next_hi, W
    subwf   _x_hi, F
    btfsc   STATUS, 0
    goto    st_up
    decf    _sum_hi, F
    comf    _x_lo, F
    comf    _x_hi, F
    incf    _x_lo, F
    btfsc   STATUS, 2
    incf    _x_hi, F
st_up:
    }
}

void step(void)
{
    asm {
; _next goes on by _x, down where _sum_hi is not 0.
    movf    _sum_hi, F
    btfss   STATUS, 2
    goto    st_down
    movf    _x_lo, W
    addwf   _next_lo, F
    btfsc   STATUS, 0
    incf    _next_hi, F
    movf    _x_hi, W
    addwf   _next_hi, F
    goto    st_gone
st_down:
    movf    _x_lo, W
    subwf   _next_lo, F
    btfss   STATUS, 0
    decf    _next_hi, F
    movf    _x_hi, W
    subwf   _next_hi, F
st_gone:
    }
}

void divide(void)
{
    asm {
; _x_hi, _x_lo = _x / _left, rounded down; _left is not 0.
    movf    _x_hi, W
    movwf   _sum_lo             ; the remainder
    clrf    _x_hi
st_whole:
    movf    _left, W
    subwf   _sum_lo, W
    btfss   STATUS, 0
    goto    st_parts
    movwf   _sum_lo
    incf    _x_hi, F
    goto    st_whole
st_parts:
    movlw   8
    movwf   FSR
st_part:
    rlf     _x_lo, F
    rlf     _sum_lo, F
    movf    _left, W
    btfsc   STATUS, 0
    goto    st_fits
    subwf   _sum_lo, W
    btfsc   STATUS, 0
    movwf   _sum_lo
    goto    st_digit
st_fits:
    subwf   _sum_lo, F
    bsf     STATUS, 0
st_digit:
    decfsz  FSR, F
    goto    st_part
    rlf     _x_lo, F
    }
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
    x_hi = FACTS[x_lo + 6];
    x_lo = FACTS[x_lo];
}

void go_neutral(void)
{
    x_lo = 24;
    look_up();
    sum_lo = x_lo;
    sum_hi = x_hi;
    go();
}

/* A command of the line: servo n goes to position value. */
void position(void)
{
    x_lo = 12;
    look_up();
    multiply();
    x_lo = 0;
    look_up();
    add();
    go();
    x_lo = 36;
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
        if (n >= 6)
            return;
        if (sum_lo == 0x00)
            position();
        else if (sum_lo == 0x40)
            speed[n] = value;
        else if (sum_lo == 0xC0)
            set_trim();
        else
            return;
    }
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
}

/* The pulse of the next slot. */
void prepare(void)
{
    slot++;
    n = slot & 0x3F;
    if (n == 9) {
        n = 0;
        slot &= 0xC0;
        begin_frame();
    }
    if (n >= 6) {
        mask = 0;
        next_hi = 1;
        return;
    }
    mask = FACTS[n + 36];
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
    set_bit(STATUS, RP0);
    TRISB = 0xC0;
    clear_bit(STATUS, RP0);
    set_bit(STATUS, RP0);
    OPTION_REG = 0x8F;   /* TMR0 counts cycles; the watchdog, if it is on, 128 times its time */
    clear_bit(STATUS, RP0);
    TMR0 = 0;   /* unknown at power-up */
    n = 6;
    while (n != 0) {
        n--;
        speed[n] = 0;
        width_high[n] = 0;
        go_neutral();
    }
    waiting = 0;
    group = 0;
    left = 0;
    todo = 0xFE;
    command = 0xFE;
    rx_bits = 0;
    rest = 0;
    slot = 8;
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
