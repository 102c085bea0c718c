; A LED on RB0 changes every half second at 4 MHz: three nested loops.

        list    p=16f84, r=dec
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF

#define LED     PORTB, 0

        cblock  0x0C
inner
middle
outer
        endc

        org     0
        goto    start

        org     5
start   bsf     STATUS, RP0
        bcf     TRISB & 0x7F, 0
        bcf     STATUS, RP0
loop    movlw   1
        xorwf   PORTB, f
        call    wait
        goto    loop

wait    movlw   5
        movwf   outer
wait1   movlw   131
        movwf   middle
wait2   movlw   250
        movwf   inner
wait3   decfsz  inner, f
        goto    wait3
        decfsz  middle, f
        goto    wait2
        decfsz  outer, f
        goto    wait1
        return

        end
