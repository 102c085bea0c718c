/* The pulse widths of four servos from their angles. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char angles[4] = {0, 45, 90, 180};

static void run(void)
{
    unsigned char n;

    for (n = 0; n < 4; n++) {
        unsigned int width = 1000 + (unsigned int)angles[n] * 11 / 2;

        add(width & 0xFF);
        add(width >> 8);
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
