/* A keypad of three columns and four rows, no key pressed. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static unsigned char scan(void)
{
    unsigned char column, row, mask;

    for (column = 0; column < 3; column++) {
        PORTB = (PORTB & 0xF1) | (unsigned char)(2 << column);
        mask = 0x10;
        for (row = 0; row < 4; row++) {
            if (PORTB & mask)
                return row * 3 + column + 1;
            mask <<= 1;
        }
    }
    return 0;
}

static void run(void)
{
    add(scan());
}

void main(void)
{
    TRISA = 0;
    TRISB = 0;
    PORTA = 0;
    PORTB = 0;
    RA0 = 1;
    run();
    RA0 = 0;
    PORTB = result;
    RA1 = 1;
    while (1)
        ;
}
