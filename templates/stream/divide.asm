; _x_hi, _x_lo = _x / _left, rounded down; _left is not 0.
    movf    _x_hi, W
    movwf   _sum_lo             ; the remainder
    clrf    _x_hi
st_whole:
    movf    _left, W
    subwf   _sum_lo, W
    btfss   STATUS, 0
    goto    st_parts
    movwf   _sum_lo
    incf    _x_hi, F
    goto    st_whole
st_parts:
    movlw   8
    movwf   FSR
st_part:
    rlf     _x_lo, F
    rlf     _sum_lo, F
    movf    _left, W
    btfsc   STATUS, 0
    goto    st_fits
    subwf   _sum_lo, W
    btfsc   STATUS, 0
    movwf   _sum_lo
    goto    st_digit
st_fits:
    subwf   _sum_lo, F
    bsf     STATUS, 0
st_digit:
    decfsz  FSR, F
    goto    st_part
    rlf     _x_lo, F
