; The value between two keyframes: eight times (value + the keyframe that the time's next bit chooses) / 2.
; In: _key, _next, _time. Out: _value, whole, and _value_low, the fraction. _time is kept.
    movf    _time, W
    movwf   _bits
    movf    _key, W
    movwf   _value
    clrf    _value_low
    movlw   8
    movwf   _count
pl_between:
    rrf     _bits, F
    movf    _key, W
    btfsc   STATUS, 0
    movf    _next, W
    addwf   _value, F
    rrf     _value, F
    rrf     _value_low, F
    decfsz  _count, F
    goto    pl_between
