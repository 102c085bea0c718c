; A servo's frame of 20 000 cycles that an EEPROM write of 10 ms is a part of.
;   cycle   1500  the pulse ends
;           1508  WR is set; EEIF is polled in 1509, 1512, …
;          11509  EEIF is set, 10 000 cycles after the cycle of WR; seen in 11511
;          11514  the rest of 8484 cycles, and the GOTO of two
; With a write of 4 ms EEIF is seen in 5511, so that the frame has 14 000 cycles.
        list    p=16f84, r=dec
        include <p16f84.inc>
        errorlevel -302
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON
delay   macro   turns           ; 3 * turns + 1 cycles
        local   again
        movlw   turns
        movwf   0x20
again   decfsz  0x20, f
        goto    again
        endm
        clrf    EEDATA
        clrf    EEADR
        clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
frame   bsf     PORTB, 0
        delay   255             ; 766 + 733 cycles
        delay   244
        bcf     PORTB, 0
        bsf     STATUS, RP0
        bcf     EECON1, EEIF
        bsf     EECON1, WREN
        movlw   0x55
        movwf   EECON2
        movlw   0xAA
        movwf   EECON2
        bsf     EECON1, WR
        btfss   EECON1, EEIF
        goto    $-1
        bcf     STATUS, RP0
blocks  set     11              ; 11 * 766 + 58 cycles
        while   blocks
        delay   255
blocks  -=      1
        endw
        delay   19
        goto    frame
        end
