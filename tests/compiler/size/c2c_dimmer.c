// Eight lamps dimmed by pulse widths on port B; their brightness runs round.
#pragma CLOCK_FREQ 4000000

char level[8];

void frame(void)
{
    char phase, n, bits;
    for (phase = 0; phase < 32; phase++) {
        bits = 0;
        for (n = 0; n < 8; n++) {
            bits = bits >> 1;
            if (level[n] > phase) bits = bits | 0x80;
        }
        PORTB = bits;
        delay_us(100);
    }
}

void main(void)
{
    char n, first, steps;

    set_tris_b(0);
    for (n = 0; n < 8; n++) level[n] = n * 4;
    while (1) {
        for (steps = 0; steps < 5; steps++) frame();
        first = level[0];
        for (n = 0; n < 7; n++) level[n] = level[n + 1];
        level[7] = first;
    }
}
