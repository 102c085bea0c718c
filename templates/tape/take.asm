; A byte of the tape, acknowledged. In: SCL is low. Out: {{ byte }}, and {{ sum }} with it.
pl_between:
{% for bit in range(8) %}
    movlw   {{ free }}
    movwf   PORTA               ; SCL rises
{{ wait(high_reading) }}    movf    PORTA, W
    addlw   0xF0                ; the carry is SDA, RA4: all other pins of the port are outputs
    rlf     {{ byte }}, F
    movlw   {{ sda }}
    movwf   PORTA               ; SCL falls
{{ wait(low) }}{% endfor %}
    clrf    PORTA               ; acknowledged
    movlw   {{ scl }}
    movwf   PORTA
{{ wait(high) }}    clrf    PORTA
    movlw   {{ sda }}
    movwf   PORTA               ; SDA is let go
{{ wait(low) }}    rlf     {{ sum }}, W
    rlf     {{ sum }}, F
    movf    {{ byte }}, W
    addwf   {{ sum }}, F
