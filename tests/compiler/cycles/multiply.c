/* Products of 8 and of 16 bits. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char a = 173, b = 211;
static volatile unsigned int c = 1234, d = 567;

static void run(void)
{
    unsigned int wide = (unsigned int)a * b;
    unsigned int product = c * d;

    add(wide & 0xFF);
    add(wide >> 8);
    add(product & 0xFF);
    add(product >> 8);
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
