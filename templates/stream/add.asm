; _sum += _x
    movf    _x_lo, W
    addwf   _sum_lo, F
    btfsc   STATUS, 0
    incf    _sum_hi, F
    movf    _x_hi, W
    addwf   _sum_hi, F
