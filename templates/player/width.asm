; The width of a channel: base + value * steps + trim, in cycles.
; In: _value, whole, and _value_low, the fraction; _key, _next: the base's bytes; _channel. Out: _key, _next.
{% if doublings or lift_doublings %}
    clrf    _value_high
{% for _ in range(doublings) %}
    bcf     STATUS, 0           ; twice
    rlf     _value_low, F
    rlf     _value, F
    rlf     _value_high, F
{% endfor %}
{% if lift_doublings %}
    btfss   _channel, 0         ; a lift
    goto    pl_scaled
{% for _ in range(lift_doublings) %}
    bcf     STATUS, 0
    rlf     _value_low, F
    rlf     _value, F
    rlf     _value_high, F
{% endfor %}
pl_scaled:
{% endif %}
    movf    _value_high, W
    addwf   _key, F
{% endif %}
    movf    _value, W
    addwf   _next, F
    btfsc   STATUS, 0
    incf    _key, F
{% if knees %}
    movf    _weight, W          ; what the calibration adds, or takes away
    btfsc   _sign, 0
    goto    pl_less
    addwf   _next, F
    btfsc   STATUS, 0
    incf    _key, F
    goto    pl_bent
pl_less:
    subwf   _next, F
    btfss   STATUS, 0
    decf    _key, F
pl_bent:
{% endif %}
; The trim is the channel's byte of the data EEPROM (DS35007 section 3.1), in two's complement; 0xFF: none.
    movf    _channel, W
    movwf   EEADR
    bsf     STATUS, 5           ; bank 1
    bsf     0x08, 0             ; EECON1, RD
    bcf     STATUS, 5
    incf    EEDATA, W
    btfsc   STATUS, 2
    goto    pl_width
    movf    EEDATA, W
    addwf   _next, F
    btfsc   STATUS, 0
    incf    _key, F
    btfsc   EEDATA, 7
    decf    _key, F
pl_width:
