; _count: 0 when no byte of the EEPROM is being written.
    clrf    _count
    bsf     STATUS, 5           ; bank 1
    movf    0x08, W             ; EECON1
    bcf     STATUS, 5
    andlw   0x02                ; WR
    movwf   _count
    clrwdt                      ; a watchdog that was left on is fed as long as main goes round
