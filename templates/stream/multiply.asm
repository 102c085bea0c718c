{% set factor = "_next_lo" if coarse else "_value" %}
; _sum_hi, _sum_lo = ({{ factor }} * _x + 128) / 256; {{ factor }} is used up.
    movlw   128
    movwf   _sum_lo
    clrf    _sum_hi
    movlw   8
    movwf   FSR
st_multiply:
    rrf     {{ factor }}, F
    btfss   STATUS, 0
    goto    st_halve
    movf    _x_lo, W
    addwf   _sum_lo, F
    btfsc   STATUS, 0
    incf    _sum_hi, F
    movf    _x_hi, W
    addwf   _sum_hi, F          ; no carry: the scale is below half of 16 bits
st_halve:
    rrf     _sum_hi, F
    rrf     _sum_lo, F
    decfsz  FSR, F
    goto    st_multiply
