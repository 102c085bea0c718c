// A button on RA0 to ground with a pull-up; each press, however it bounces, toggles the LED on RB0.
#pragma CLOCK_FREQ 4000000

char pressed()
{
    if (PORTA & 00000001b) return 0;
    delay_ms(20);                      // wait until the contact is quiet
    if (PORTA & 00000001b) return 0;
    return 1;
}

void released()
{
    char quiet;
    quiet = 0;
    while (quiet < 20) {
        delay_ms(1);
        if (test_bit(PORTA, 0)) quiet++;
        else quiet = 0;
    }
}

void main(void)
{
    set_tris_a(00011111b);
    set_tris_b(11111110b);
    output_low_port_b(0);
    for (;;) {
        if (pressed()) {
            toggle_bit(PORTB, 0);
            released();
        }
    }
}
