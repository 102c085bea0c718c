; heartbeat.asm: a lamp on RB0, on for 100 ms in every second.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
        cblock  0x0C
inner, outer, tenths
        endc

        org     0
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    PORTB
beat    bsf     PORTB, 0
        call    tenth
        bcf     PORTB, 0
        movlw   .9
        movwf   tenths
off     call    tenth
        decfsz  tenths, f
        goto    off
        goto    beat

tenth   movlw   .130                    ; 130 * (256 * 3 + 2) cycles are 100 ms
        movwf   outer
        clrf    inner
wait    decfsz  inner, f
        goto    wait
        decfsz  outer, f
        goto    wait
        return
        end
