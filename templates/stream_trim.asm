; Byte _n of the data EEPROM (DS35007 section 3.1), as cycles in _x_hi, _x_lo; the erased byte is no trim.
    movf    _n, W
    movwf   EEADR
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 0             ; EECON1, RD
    bcf     STATUS, 5
    movf    EEDATA, W
    movwf   _x_lo
    clrf    _x_hi
    incf    _x_lo, W
    btfsc   STATUS, 2
    clrf    _x_lo
    btfsc   _x_lo, 7
    decf    _x_hi, F
