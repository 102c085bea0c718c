; polled_clock.asm: RB1 changes at each overflow of TMR0, which counts four cycles: every 1024 cycles.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF

        org     0
        bsf     STATUS, RP0
        clrf    TRISB
        movlw   0x81                    ; a prescaler of 1:4
        movwf   OPTION_REG
        bcf     STATUS, RP0
        clrf    PORTB
        clrf    TMR0
loop    btfss   INTCON, T0IF
        goto    loop
        bcf     INTCON, T0IF
        movlw   0x02
        xorwf   PORTB, f
        goto    loop
        end
