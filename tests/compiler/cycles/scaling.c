/* A reading of 0 to 255 as tenths of a degree, signed. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char readings[3] = {0, 100, 255};

static void run(void)
{
    unsigned char n;

    for (n = 0; n < 3; n++) {
        int tenths = (int)readings[n] * 5 - 400;

        if (tenths < 0)
            tenths = -tenths;
        add(tenths & 0xFF);
        add(tenths >> 8);
    }
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
