// An electronic dice: seven LEDs on port B, a button on RA0; a shift register makes the chance.
#pragma CLOCK_FREQ 4000000

const char faces[6] = {0x08, 0x41, 0x49, 0x63, 0x6B, 0x77};
int noise;

char next(void)
{
    char bit;
    bit = noise ^ (noise >> 2) ^ (noise >> 3) ^ (noise >> 5);
    noise = noise >> 1;
    if (bit & 1) noise = noise | 0x8000;
    return noise & 0xFF;
}

void main(void)
{
    char n, face;

    set_tris_a(0x1F);
    set_tris_b(0);
    noise = 0xACE1;
    PORTB = 0;
    while (1) {
        while (test_bit(PORTA, 0)) next();
        for (n = 0; n < 20; n++) {
            do face = next() & 7; while (face > 5);
            PORTB = faces[face];
            delay_ms(50);
        }
        while (!test_bit(PORTA, 0)) nop();
    }
}
