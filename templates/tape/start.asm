; A start, wherever the EEPROM is: it lets go of SDA within nine clocks.
    movlw   10
    movwf   _count
tp_free:
    movlw   {{ free }}
    movwf   PORTA               ; SCL rises
{{ wait(high_reading) }}    btfsc   PORTA, 4
    goto    tp_start
    movlw   {{ sda }}
    movwf   PORTA               ; SCL falls
{{ wait(low) }}    decfsz  _count, F
    goto    tp_free
    bsf     _lost, 0            ; SDA is stuck
tp_start:
    movlw   {{ scl }}
    movwf   PORTA               ; SDA falls while SCL is high
{{ wait(high) }}    clrf    PORTA
{{ wait(low) }}
