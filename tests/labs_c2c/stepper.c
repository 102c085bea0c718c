// A unipolar stepper motor on RB4 to RB7: 24 half steps one way, a rest, 24 back, 5 ms each.
#pragma CLOCK_FREQ 4000000

const char phases[8] = {00010000b, 00110000b, 00100000b, 01100000b, 01000000b, 11000000b, 10000000b, 10010000b};
char at;

void turn(char steps, char forward)
{
    do {
        if (forward) at = (at + 1) & 7;
        else at = (at - 1) & 7;
        PORTB = phases[at];
        delay_ms(5);
    } while (--steps);
    PORTB = 0;
    delay_ms(50);
}

void main(void)
{
    set_tris_b(0x0F);
    PORTB = 0;
    at = 0;
    while (1) {
        turn(24, 1);
        turn(24, 0);
    }
}
