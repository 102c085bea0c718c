; supervisor.asm: feeds an external watchdog (RB7 must change within 5 ms) between pieces of work, which last
; longer while RA1 is high; the chip's own watchdog runs, too.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_ON & _PWRTE_ON & _CP_OFF
inner   equ     0x0C
outer   equ     0x0D

        org     0
        clrf    PORTB
        bsf     STATUS, RP0
        bcf     TRISB, 7
        bcf     STATUS, RP0
loop    clrwdt
        movlw   0x80
        xorwf   PORTB, f
        movlw   .2
        btfsc   PORTA, 1
        movlw   .5
        movwf   outer
        clrf    inner
work    decfsz  inner, f
        goto    work
        decfsz  outer, f
        goto    work
        goto    loop
        end
