/* The five digits of a 16-bit number. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned int number = 54321;

static void run(void)
{
    unsigned int left = number;
    unsigned char n;

    for (n = 0; n < 5; n++) {
        add(left % 10);
        left /= 10;
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
