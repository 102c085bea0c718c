; Counts its starts in the data EEPROM and shows the count on port B.

        list    p=16f84
        include <p16f84.inc>
        errorlevel -302
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
        __idlocs 0x2026

starts  equ     0                       ; a place in the EEPROM

        org     0x2100
        de      0, "servo", 0xFF

        org     0
        movlw   starts
        movwf   EEADR
        banksel EECON1
        bsf     EECON1, RD
        banksel EEDATA
        incf    EEDATA, f
        banksel EECON1
        bsf     EECON1, WREN
        movlw   0x55
        movwf   EECON2
        movlw   0xAA
        movwf   EECON2
        bsf     EECON1, WR
busy    btfsc   EECON1, WR
        goto    busy
        bcf     EECON1, WREN
        clrf    TRISB
        banksel EEDATA
        movf    EEDATA, w
        movwf   PORTB
        sleep
        goto    $-1
        end
