; What a channel's calibration adds beyond its knee: (value - knee) * bend / 256 steps, in cycles.
; In: _value; _next, the knee; _key, the bend, whose bit 7 is set where it is less. Out: _weight; _sign, bit 0: less.
    bcf     _sign, 0
    btfsc   _key, 7
    bsf     _sign, 0
    clrf    _weight
    movlw   {{ bits }}
    movwf   _count
    movf    _next, W
    subwf   _value, W
    btfss   STATUS, 0
    goto    pl_straight
pl_knee:
    rrf     _key, F
    btfsc   STATUS, 0
    addwf   _weight, F
    rrf     _weight, F
    decfsz  _count, F
    goto    pl_knee
pl_straight:
