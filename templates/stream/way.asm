; The way from _next to _x: its length in _x_hi, _x_lo; _sum_hi is 0xFF where it goes down, else 0.
    clrf    _sum_hi
    movf    _next_lo, W
    subwf   _x_lo, F
    movf    _next_hi, W
    btfss   STATUS, 0
    incfsz  _next_hi, W
    subwf   _x_hi, F
    btfsc   STATUS, 0
    goto    st_up
    decf    _sum_hi, F
    comf    _x_lo, F
    comf    _x_hi, F
    incf    _x_lo, F
    btfsc   STATUS, 2
    incf    _x_hi, F
st_up:
