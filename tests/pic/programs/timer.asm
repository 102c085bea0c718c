; TMR0 overflows every 65.5 ms at 4 MHz; the interrupt counts, and RB0 shows the count's bit 3.

        processor 16f84a
        include "p16f84a.inc"
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
        radix   dec

        cblock  0x0C
        w_saved, status_saved
ticks
        endc

push    macro
        movwf   w_saved
        swapf   STATUS, w
        movwf   status_saved
        endm

pop     macro
        swapf   status_saved, w
        movwf   STATUS
        swapf   w_saved, f
        swapf   w_saved, w
        endm

        org     0
        goto    main
        org     4
        push
        btfss   INTCON, T0IF
        goto    done
        bcf     INTCON, T0IF
        incf    ticks, f
done    pop
        retfie

main    clrf    ticks
        clrf    PORTB
        bsf     STATUS, RP0
        movlw   b'11010111'             ; TMR0 from the clock, prescaler 256
        movwf   OPTION_REG ^ 0x80
        movlw   0xFE
        movwf   TRISB ^ 0x80
        bcf     STATUS, RP0
        movlw   1 << GIE | 1 << T0IE
        movwf   INTCON
show    btfsc   ticks, 3
        bsf     PORTB, 0
        btfss   ticks, 3
        bcf     PORTB, 0
        b       show
        end
