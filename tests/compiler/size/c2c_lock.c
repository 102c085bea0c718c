// A combination lock: four keys on RB4 to RB7, a code of six, a relay on RA0, three wrong codes lock it.
#pragma CLOCK_FREQ 4000000

const char code[6] = {0x10, 0x40, 0x20, 0x20, 0x80, 0x10};
char wrong;

char key(void)
{
    char down;
    do {
        down = PORTB & 0xF0;
    } while (down == 0xF0);
    delay_ms(20);
    while ((PORTB & 0xF0) != 0xF0) clear_wdt();
    delay_ms(20);
    return down ^ 0xF0;
}

char entered(void)
{
    char n, good;
    good = 1;
    for (n = 0; n < 6; n++) {
        if (key() != code[n]) good = 0;
    }
    return good;
}

void main(void)
{
    set_tris_a(0);
    set_tris_b(0xF0);
    set_option(0x00);
    PORTA = 0;
    wrong = 0;
    while (1) {
        if (entered()) {
            wrong = 0;
            output_high_port_a(0);
            delay_s(5);
            output_low_port_a(0);
        } else {
            wrong++;
            if (wrong >= 3) {
                output_high_port_a(1);
                delay_s(60);
                output_low_port_a(1);
                wrong = 0;
            }
        }
    }
}
