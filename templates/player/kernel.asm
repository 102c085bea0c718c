{% macro pad(number) %}
    movlw   {{ pads[number - 1].turns }}
    movwf   _count
pl_pad{{ number }}:
    decfsz  _count, F
    goto    pl_pad{{ number }}
{%- for line in pads[number - 1].rest %}

    {{ line }}
{%- endfor %}
{%- endmacro %}
; One slot of the frame: two servos of one port rise {{ 'shortly one after the other' if stagger else 'together' }} and fall each at its own cycle.
;
; STATUS bit 0 is the carry, bit 2 is zero.
;
; In:  _pulse_a, _pulse_b    widths in cycles (_hi, _lo) of the two channels
;      _mask_a, _mask_b      their pins; the same width and mask 0 where a slot has one channel
;      _both                 both pins, or 0: no pulses
;      _port                 the port's address
;      _target, _ahead       TMR0 at which the slot begins, and the ticks since the slot before
; Out: _overrun              bit 0 set where the slot's beginning had passed
;
; The sooner pulse's width goes to _pulse_a, the difference to _pulse_b, the pin that stays high to _stay.
{% if stagger %}
    movlw   {{ stagger }}                  ; b rises so much later
    addwf   _pulse_b_lo, F
    btfsc   STATUS, 0
    incf    _pulse_b_hi, F
{% endif %}
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
; The sooner pulse: {{ way }} cycles are the way, the rest is loops of 8 cycles and 0 to 7 cycles in _fine.
    movlw   {{ way }}
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
; last cycle before it. A tick is {{ tick }} cycles.
pl_poll:
    movf    TMR0, W             ; cycle 0 to 4 of the tick
    xorwf   _target, W
    btfss   STATUS, 2
    goto    pl_poll
    incf    _target, F          ; 4
{{ pad(1) }}
    movf    _target, W          ; {{ reads[0] - 1 }}
    subwf   TMR0, W             ; {{ reads[0] }}: the next tick has come where the poll was 2 to 4 late
    btfss   STATUS, 2
    goto    $+1
    btfss   STATUS, 2
    goto    $+1
    incf    _target, F          ; {{ reads[0] + 7 }}, 0 to 2 late
{{ pad(2) }}
    movf    _target, W          ; {{ reads[1] - 1 }}
    subwf   TMR0, W             ; {{ reads[1] }}: come where 1 or 2 late
    btfss   STATUS, 2
    goto    $+1
    incf    _target, F          ; {{ reads[1] + 4 }}, 0 or 1 late
{{ pad(3) }}
    movf    _target, W          ; {{ reads[2] - 1 }}
    subwf   TMR0, W             ; {{ reads[2] }}: come where 1 late
    btfss   STATUS, 2
    goto    $+1
; Cycle {{ reads[2] + 4 }} after the beginning, always.
{% if wire and not early %}
    comf    PORT{{ wire }}, W            ; the wire: its bit is set if it is low,
    andwf   PORT{{ wire }}, W            ; then high,
    andwf   PORT{{ wire }}, W            ; and high
    movwf   _seen
{% endif %}
    movf    _both, W
    btfsc   STATUS, 2
    goto    {{ "pl_idle" if early else "pl_done" }}             ; no pulses
{% if stagger %}
    andwf   _mask_a, W
    movwf   INDF                ; a rises: cycle 0
    movlw   9
    movwf   _count
pl_apart_pad:
    decfsz  _count, F
    goto    pl_apart_pad
    goto    $+1
    movf    _both, W
    movwf   INDF                ; b rises: cycle {{ stagger }}
{% else %}
    movwf   INDF                ; both rise: cycle 0
{% endif %}
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
{% if early %}
    goto    pl_done
; The slot that awaits the wire: {{ early + 1 }} looks for its rise, 2 cycles apart, which comes before the middle one or after it,
; as both chips' crystals are. If the first look is high, or all are low, _joined stays 0.
pl_idle:
    btfsc   _joined, 0
    goto    pl_done
{{ pad(4) }}
    btfsc   PORT{{ wire }}, {{ bit }}
    goto    pl_done
{% for look in range(early) %}
    btfsc   PORT{{ wire }}, {{ bit }}
    goto    pl_rose
{% endfor %}
    goto    pl_done
pl_rose:
    clrf    TMR0                ; 3 cycles after the look: the frame's slots are counted from here
    bsf     _joined, 0
    movlw   3
    movwf   _target
{% endif %}
pl_done:
    clrwdt
    movlw   3
    subwf   _target, F          ; where the lock began
