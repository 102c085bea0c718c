// Counts how often the chip was started, in EEPROM cell 5, and shows the number on port B.
#pragma CLOCK_FREQ 4000000

char read_cell(char address)
{
    EEADR = address;
    set_bit(STATUS, RP0);
    set_bit(EECON1, RD);
    clear_bit(STATUS, RP0);
    return EEDATA;
}

void write_cell(char address, char value)
{
    EEADR = address;
    EEDATA = value;
    set_bit(STATUS, RP0);
    clear_bit(INTCON, GIE);
    set_bit(EECON1, WREN);
    asm {
        movlw 0x55
        movwf EECON2
        movlw 0xAA
        movwf EECON2
        bsf EECON1, WR
    }
    while (test_bit(EECON1, WR));
    clear_bit(EECON1, WREN);
    clear_bit(STATUS, RP0);
}

void main(void)
{
    char starts;

    set_tris_b(0);
    starts = read_cell(5);
    if (starts == 0xFF) starts = 0;    // a new chip
    starts = starts + 1;
    write_cell(5, starts);
    PORTB = starts;
    while (1);
}
