// A thermostat with hysteresis; the set point is kept in EEPROM, buttons on RA0 and RA1 change it.
#pragma CLOCK_FREQ 4000000

char wanted, heats;

char measured(void)
{
    char count;
    set_bit(PORTA, 2);
    count = 0;
    while (!test_bit(PORTA, 3)) {
        count++;
        if (count == 255) break;
    }
    clear_bit(PORTA, 2);
    return count;
}

void keep(void)
{
    EEADR = 0;
    EEDATA = wanted;
    set_bit(EECON1, WREN);
    clear_bit(INTCON, GIE);
    EECON2 = 0x55;
    EECON2 = 0xAA;
    set_bit(EECON1, WR);
    while (test_bit(EECON1, WR)) nop();
    clear_bit(EECON1, WREN);
}

char button(char bit)
{
    if (PORTA & (1 << bit)) return 0;
    delay_ms(20);
    while (!(PORTA & (1 << bit))) nop();
    return 1;
}

void main(void)
{
    char value;

    PORTA = 0;
    set_tris_a(0x1B);
    set_tris_b(0);
    EEADR = 0;
    set_bit(EECON1, RD);
    wanted = EEDATA;
    if (wanted == 0xFF) wanted = 100;
    heats = 0;
    while (1) {
        if (button(0)) { wanted++; keep(); }
        if (button(1)) { wanted--; keep(); }
        value = measured();
        if (heats) {
            if (value > wanted + 2) heats = 0;
        } else if (value < wanted - 2) {
            heats = 1;
        }
        PORTB = wanted;
        if (heats) set_bit(PORTB, 7);
        else clear_bit(PORTB, 7);
    }
}
