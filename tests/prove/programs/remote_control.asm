; remote_control.asm: while the button on RA0 is pressed, a burst of 21 waves of 38 kHz every 10 ms on RB0.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
waves   equ     0x0C
pause   equ     0x0D
inner   equ     0x0E

        org     0
        clrf    PORTB
        bsf     STATUS, RP0
        bcf     TRISB, 0
        bcf     STATUS, RP0
idle    btfsc   PORTA, 0
        goto    idle
        movlw   .21
        movwf   waves
wave    bsf     PORTB, 0                ; high for 9 of 26 cycles
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        bcf     PORTB, 0
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        goto    $+1
        nop
        decfsz  waves, f
        goto    wave
        movlw   .12
        movwf   pause
        clrf    inner
gap     decfsz  inner, f
        goto    gap
        decfsz  pause, f
        goto    gap
        goto    idle
        end
