/* Two bytes into a 74HC595. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char first = 0xA5, second = 0x3C;

static void out(unsigned char value)
{
    unsigned char n;

    for (n = 8; n; n--) {
        if (value & 0x80)
            RB1 = 1;
        else
            RB1 = 0;
        RB2 = 1;
        RB2 = 0;
        value <<= 1;
    }
}

static void run(void)
{
    out(first);
    out(second);
    RB3 = 1;
    RB3 = 0;
    add(PORTB);
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
