; shift_register.asm: a byte that counts goes to a 74HC595: data RB0, clock RB1, latch RB2.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
value   equ     0x0C
shifted equ     0x0D
bits    equ     0x0E

        org     0
        clrf    PORTB
        bsf     STATUS, RP0
        movlw   b'11111000'
        movwf   TRISB
        bcf     STATUS, RP0
loop    incf    value, f
        movf    value, w
        movwf   shifted
        movlw   .8
        movwf   bits
bit     bcf     PORTB, 0
        rlf     shifted, f
        btfsc   STATUS, C
        bsf     PORTB, 0
        bsf     PORTB, 1
        nop
        bcf     PORTB, 1
        decfsz  bits, f
        goto    bit
        bsf     PORTB, 2
        nop
        bcf     PORTB, 2
        goto    loop
        end
