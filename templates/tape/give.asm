; {{ byte }} to the EEPROM. In: SCL is low. Out: _lost is not 0 where it was not acknowledged.
    movlw   8
    movwf   _count
tp_bit:
    rlf     {{ byte }}, F
    movlw   0
    btfsc   STATUS, 0
    movlw   {{ sda }}
    movwf   PORTA
{{ wait(low) }}    iorlw   {{ scl }}
    movwf   PORTA               ; SCL rises
{{ wait(high) }}    andlw   {{ sda }}
    movwf   PORTA               ; SCL falls
    decfsz  _count, F
    goto    tp_bit
    movlw   {{ sda }}
    movwf   PORTA               ; SDA is let go
{{ wait(low) }}    movlw   {{ free }}
    movwf   PORTA
{{ wait(high_reading) }}    movf    PORTA, W
    andlw   {{ sda }}
    iorwf   _lost, F
    movlw   {{ sda }}
    movwf   PORTA
{{ wait(low) }}
