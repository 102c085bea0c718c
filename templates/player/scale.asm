    bcf     STATUS, 0           ; twice
    rlf     _value_low, F
    rlf     _value, F
    rlf     _value_high, F
