; The trim that the byte _x_lo is, as cycles in _x_hi, _x_lo; the erased byte is none.
    clrf    _x_hi
    incf    _x_lo, W
    btfsc   STATUS, 2
    clrf    _x_lo
    btfsc   _x_lo, 7
    decf    _x_hi, F
