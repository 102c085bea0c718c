// A keypad of 3 columns (RB0 to RB2, driven low in turn) and 4 rows (RB4 to RB7 with the chip's pull-ups).
// The number of the key that is down, 1 to 12, is shown on port A; 0 when none is.
#pragma CLOCK_FREQ 4000000

char scan(void)
{
    char column, rows, key;

    key = 1;
    for (column = 0; column < 3; column++) {
        PORTB = ~(1 << column);
        delay_us(20);
        rows = PORTB & 0xF0;
        switch (rows) {
        case 0xE0: return key;
        case 0xD0: return key + 3;
        case 0xB0: return key + 6;
        case 0x70: return key + 9;
        }
        key++;
    }
    return 0;
}

void main(void)
{
    char old, now;

    set_tris_a(0);
    set_tris_b(0xF0);
    set_option(00000000b);             // pull-ups on
    PORTA = 0;
    old = 0;
    while (1) {
        now = scan();
        if (now != old) {
            delay_ms(10);
            if (scan() == now) {
                old = now;
                PORTA = now;
            }
        }
    }
}
