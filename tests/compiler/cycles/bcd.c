/* Counting in BCD, four digits. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static unsigned char digits[4] = {9, 9, 8, 0};

static void count(void)
{
    unsigned char n;

    for (n = 0; n < 4; n++) {
        if (++digits[n] < 10)
            return;
        digits[n] = 0;
    }
}

static void run(void)
{
    unsigned char n;

    for (n = 0; n < 12; n++)
        count();
    for (n = 0; n < 4; n++)
        add(digits[n]);
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
