; The channel's byte of the data EEPROM (DS35007 section 3.1).
    movf    _channel, W
    movwf   EEADR
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 0             ; EECON1, RD
    bcf     STATUS, 5
    movf    EEDATA, W
    movwf   _value
