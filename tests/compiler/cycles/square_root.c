/* The integer square root of 16 bits. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned int number = 54321;

static void run(void)
{
    unsigned int left = number, root = 0, bit = 0x4000;

    while (bit) {
        if (left >= root + bit) {
            left -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
        bit >>= 2;
    }
    add(root);
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
