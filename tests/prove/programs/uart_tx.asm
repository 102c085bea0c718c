; uart_tx.asm: the letters A to Z at 9600 baud on RB5, again and again.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
        cblock  0x0C
letter, byte, bits, count
        endc

        org     0
        bsf     PORTB, 5
        bsf     STATUS, RP0
        bcf     TRISB, 5
        bcf     STATUS, RP0
start   movlw   'A'
        movwf   letter
next    movf    letter, w
        call    send
        incf    letter, f
        movlw   'Z' + 1
        subwf   letter, w
        btfss   STATUS, C
        goto    next
        goto    start

send    movwf   byte                    ; a bit is 104 cycles
        movlw   .9
        movwf   bits
        bcf     STATUS, C               ; the start bit
bit     btfsc   STATUS, C
        goto    one
        nop
        bcf     PORTB, 5
        goto    hold
one     bsf     PORTB, 5
        goto    hold
hold    movlw   .30
        movwf   count
        decfsz  count, f
        goto    $-1
        nop
        nop
        nop
        rrf     byte, f
        decfsz  bits, f
        goto    bit
        goto    $+1
        bsf     PORTB, 5                ; the stop bit
        movlw   .40
        movwf   count
        decfsz  count, f
        goto    $-1
        return
        end
