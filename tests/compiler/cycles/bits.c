/* The ones of two bytes, and their bits turned round. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char values[2] = {0xB7, 0x1E};

static void run(void)
{
    unsigned char k, n;

    for (k = 0; k < 2; k++) {
        unsigned char left = values[k], ones = 0, turned = 0;

        for (n = 8; n; n--) {
            turned <<= 1;
            if (left & 1) {
                ones++;
                turned |= 1;
            }
            left >>= 1;
        }
        add(ones);
        add(turned);
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
