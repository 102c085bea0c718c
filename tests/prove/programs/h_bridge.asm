; h_bridge.asm: a motor whose direction RA0 sets; the upper switches are RB0 and RB1, the lower ones RB2 and RB3.
; All are off for 20 cycles before the other pair closes.
        list    p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
now     equ     0x0C
wanted  equ     0x0D
count   equ     0x0E

        org     0
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    now
loop    movlw   b'00001001'             ; forwards: RB0 and RB3
        btfsc   PORTA, 0
        movlw   b'00000110'             ; backwards: RB1 and RB2
        movwf   wanted
        xorwf   now, w
        btfsc   STATUS, Z
        goto    loop
        clrf    PORTB
        movlw   .6
        movwf   count
dead    decfsz  count, f
        goto    dead
        movf    wanted, w
        movwf   now
        movwf   PORTB
        goto    loop
        end
