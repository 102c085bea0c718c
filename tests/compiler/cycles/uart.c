/* A byte, bit by bit, as a software UART shifts it out. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char byte = 0x5A;

static void run(void)
{
    unsigned char value = byte, n;

    RB1 = 0;
    for (n = 0; n < 8; n++) {
        if (value & 1)
            RB1 = 1;
        else
            RB1 = 0;
        value >>= 1;
    }
    RB1 = 1;
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
