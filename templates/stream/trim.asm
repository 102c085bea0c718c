; Byte _n of the data EEPROM (DS35007 section 3.1) to _x_lo.
    movf    _n, W
    movwf   EEADR
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 0             ; EECON1, RD
    bcf     STATUS, 5
    movf    EEDATA, W
    movwf   _x_lo
