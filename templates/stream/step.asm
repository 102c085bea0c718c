; _next goes on by _x, down where _sum_hi is not 0.
    movf    _sum_hi, F
    btfss   STATUS, 2
    goto    st_down
    movf    _x_lo, W
    addwf   _next_lo, F
    btfsc   STATUS, 0
    incf    _next_hi, F
    movf    _x_hi, W
    addwf   _next_hi, F
    goto    st_gone
st_down:
    movf    _x_lo, W
    subwf   _next_lo, F
    btfss   STATUS, 0
    decf    _next_hi, F
    movf    _x_hi, W
    subwf   _next_hi, F
st_gone:
