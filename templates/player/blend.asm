; key * 256 + (next - key) * weight{{ ", the product twice where bit 1 of _sign is set" if twice }}: 16 bits.
; In: _key, _next, _weight, _sign (bit 0 clear). Out: _value, whole, and _value_low, the fraction.
    movf    _key, W
    subwf   _next, W
    btfsc   STATUS, 0
    goto    pl_rising
    sublw   0                   ; key - next
    bsf     _sign, 0
pl_rising:
    movwf   _value_high
    movf    _weight, W
    movwf   _value_low
    clrf    _value
    movlw   8
    movwf   _count
    movf    _value_high, W
    rrf     _value_low, F
pl_between:
    btfsc   STATUS, 0
    addwf   _value, F
    rrf     _value, F
    rrf     _value_low, F
    decfsz  _count, F
    goto    pl_between
{% if twice %}
    bcf     STATUS, 0
    btfss   _sign, 1
    goto    pl_once
    rlf     _value_low, F
    rlf     _value, F
pl_once:
{% endif %}
    btfss   _sign, 0
    goto    pl_sum
    comf    _value, F
    comf    _value_low, F
    incf    _value_low, F
    btfsc   STATUS, 2
    incf    _value, F
pl_sum:
    movf    _key, W
    addwf   _value, F
