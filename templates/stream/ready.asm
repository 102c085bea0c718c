; _x_lo: 0 when no byte of the EEPROM is being written.
    bsf     STATUS, 5           ; bank 1
    movf    0x08, W             ; EECON1
    bcf     STATUS, 5
    andlw   0x02                ; WR
    movwf   _x_lo
    clrwdt                      ; a watchdog that was left on is fed as long as main goes round
