/* A moving average over four readings, eight times. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static unsigned char last[4];
static volatile unsigned char step = 37;

static void run(void)
{
    unsigned char n, reading = 11;

    for (n = 0; n < 8; n++) {
        unsigned int sum;

        last[n & 3] = reading;
        sum = last[0] + last[1];
        sum += last[2];
        sum += last[3];
        add(sum >> 2);
        reading += step;
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
