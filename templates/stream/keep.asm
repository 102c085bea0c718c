; Begins to write _value to byte _n of the data EEPROM (DS35007 section 3.2); it takes about 10 ms.
    movf    _n, W
    movwf   EEADR
    movf    _value, W
    movwf   EEDATA
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 2             ; EECON1, WREN
    bcf     INTCON, 7           ; GIE; an interrupt that came with it would have set it again
    btfsc   INTCON, 7
    goto    $-2
    movlw   0x55
    movwf   0x09                ; EECON2
    movlw   0xAA
    movwf   0x09
    bsf     0x08, 1             ; WR
    bsf     INTCON, 7
    bcf     0x08, 2
    bcf     STATUS, 5
