; Every 128 cycles: one or two looks at the line. In the rounds of 256 cycles that have an edge: the edge, and the looks around it.
;
; STATUS bit 0 is the carry, bit 2 is zero. TMR0 counts cycles. A round without an edge has two interrupts: each adds 128 to TMR0, so
; that the next one comes 128 cycles after it; after two of them TMR0 shows the time again. _ticks counts the interrupts until the
; round with the next edge; it is odd whenever TMR0 shows the time, and even when TMR0 is 128 ahead of it. So the time is known
; however late the interrupt came. An edge is in the cycle that st_exactly finds; all else may take any time below its limit.
;
; In:  _next_lo, _next_hi, _mask   the pulse of the slot that comes: width in cycles, pin
; Out: _due                        bit 1: prepare the next slot; it is cleared when that is done
;                                  bit 2: a command that is in _todo came before
;                                  bit 0: a slot was not prepared in time, once (overrun)
;      _todo, _value               a command's second and third byte
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
; An edge: looks 64 cycles apart, the last {{ last }} before it, or one less. _ticks, kept odd, is free until it is set anew.
    movf    _rest, F
    btfss   STATUS, 2
    goto    st_fall
    clrf    _fine               ; a rise; a fall is _fine cycles later in its round
{% if two_ports %}
    movf    _next_port, W
    movwf   _port
{% endif %}
    btfss   _due, 1
    goto    st_fall
    clrf    _mask               ; not prepared: no pulse
    bsf     _due, 0
st_fall:
    movlw   0x3F
    andwf   _fine, W
    addlw   {{ rise - last }}
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
    xorlw   {{ rise - last + 64 }}
    andlw   0xFE
    btfss   STATUS, 2
    goto    st_before
{% if two_ports %}
    movf    _port, W
    movwf   FSR
{% endif %}
    movf    _fine, W
    addlw   {{ rise }}
    call    st_exactly
    movf    _rest, F
    movlw   0
    btfsc   STATUS, 2
    movf    _mask, W
    movwf   {{ port }}               ; the edge
    movf    _rest, F
    btfss   STATUS, 2
    goto    st_fallen
    call    st_look
    decf    _next_hi, W         ; two interrupts per round, less one: the first one's
    addwf   _next_hi, W
    movwf   _ticks
    sublw   {{ 2 * slot_ticks - 2 }}
    movwf   _rest
    movf    _next_lo, W
    movwf   _fine
    bsf     _due, 1
    movlw   {{ nothing }}
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
    movlw   {{ 256 - late }}
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
    movlw   {{ 256 - latest_second }}
    addwf   TMR0, W
    btfsc   STATUS, 0
    goto    st_out
st_second:
    movlw   {{ second }}
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
    movlw   {{ bit_units }}
    addwf   _rx_left, F
{% if answers %}
    btfsc   _rx_bits, 6
    goto    st_send
{% endif %}
    decfsz  _rx_bits, F
    goto    st_bit
    btfss   {{ line_port }}, {{ line_bit }}
    goto    st_break            ; no stop bit
    incf    _rx_byte, W
    btfsc   STATUS, 2
    goto    st_sync
    incf    _command, W
    btfsc   STATUS, 2
    goto    st_what
    movlw   {{ nothing }}
    xorwf   _command, W
    btfsc   STATUS, 2
    return
    xorlw   {{ nothing }}
    movwf   _todo
    movf    _rx_byte, W
    movwf   _value
    movlw   {{ nothing }}
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
    btfsc   {{ line_port }}, {{ line_bit }}
    return
    movf    TMR0, W             ; a start bit begins
    btfss   _ticks, 0
    addlw   128
    movwf   _t
    rrf     _t, F
    rrf     _t, W             ; only its lowest six bits count
    movwf   _rx_last
    movlw   {{ first_units }}
    movwf   _rx_left
    movlw   10
    movwf   _rx_bits
    return
st_break:
    movlw   {{ nothing }}
    movwf   _command
    movlw   0x80
    movwf   _rx_bits
    return
st_broken:
    btfsc   {{ line_port }}, {{ line_bit }}
    clrf    _rx_bits
    return
st_bit:
    btfss   _rx_bits, 3
    goto    st_data
    btfss   _rx_bits, 0
    goto    st_data
    btfsc   {{ line_port }}, {{ line_bit }}
    clrf    _rx_bits            ; no start bit: noise
    return
st_data:
    bcf     STATUS, 0
    btfsc   {{ line_port }}, {{ line_bit }}
    bsf     STATUS, 0
    rrf     _rx_byte, F
    return
{% if answers %}
; An answer: _rx_bits is 0x4A before its start bit and counts to 0x40, the stop bit. The receiver is deaf so long.
st_send:
    decf    _rx_bits, F
    bsf     STATUS, 0
    btfss   _rx_bits, 3
    goto    st_shift
    btfss   _rx_bits, 0
    goto    st_shift
    movwf   _rx_left            ; the start bit is a bit long, whenever it was asked for
    bcf     {{ out_port }}, {{ out_bit }}
    return
st_shift:
    rrf     _rx_byte, F
    btfss   STATUS, 0
    bcf     {{ out_port }}, {{ out_bit }}
    btfsc   STATUS, 0
    bsf     {{ out_port }}, {{ out_bit }}
    movlw   0x3F
    andwf   _rx_bits, W
    btfsc   STATUS, 2
    clrf    _rx_bits
    return
{% endif %}
; A round without an edge: the next interrupt comes 128 cycles after this one.
st_plain:
    movlw   {{ 256 - late }}
    addwf   TMR0, W
    btfsc   STATUS, 0
    goto    st_late             ; only after an edge
    movlw   131                 ; 128, and the three cycles that TMR0 stands still (DS35007 figure 5-2)
    addwf   TMR0, F
st_out:
