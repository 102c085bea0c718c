; A servo on RB0: pulses of about 1 ms, 1.5 ms and 2 ms, 50 of each, about every 20 ms at 4 MHz.

        list    p=16f84, r=dec
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF

        cblock  0x0C
        count, frames
        endc

TURN    equ     10                      ; cycles of a turn of the loop in wait

; waits 10 * turns + 1 cycles
wait    macro   turns
        local   again
        movlw   turns
        movwf   count
again   goto    $+1
        goto    $+1
        goto    $+1
        nop
        decfsz  count, f
        goto    again
        endm

; waits a number of cycles in pieces of at most 2500
longer  macro   cycles
        local   left=cycles
        while   left > 0
        if      left > 2500
        wait    250
        else
        wait    left / TURN
        endif
left    -= 2500
        endw
        endm

pulse   macro   width
        bsf     PORTB, 0
        wait    (width) / TURN
        bcf     PORTB, 0
        longer  20000 - (width)
        endm

position macro  width, times
        local   next
        movlw   times
        movwf   frames
next    pulse   width
        decfsz  frames, f
        goto    next
        endm

        org     0
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB & 0x7F
        bcf     STATUS, RP0
loop
width   set     1000
        while   width <= 2000
        position width, 50
width   set     width + 500
        endw
        goto    loop
        end
