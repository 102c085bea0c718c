// Eight LEDs on port B: one light runs to the left and back.
#pragma CLOCK_FREQ 4000000

void main(void)
{
    char led, step;

    set_bit(STATUS, RP0);
    TRISB = 0;
    clear_bit(STATUS, RP0);

    led = 1;
    while (1) {
        for (step = 0; step < 7; step++) {
            PORTB = led;
            delay_ms(100);
            led = led << 1;
        }
        for (step = 0; step < 7; step++) {
            PORTB = led;
            delay_ms(100);
            led = led >> 1;
        }
    }
}
