/* Quotients and remainders by variables. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char a = 211, b = 17;
static volatile unsigned int c = 54321, d = 678;

static void run(void)
{
    add(a / b);
    add(a % b);
    add(c / d);
    add((c % d) & 0xFF);
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
