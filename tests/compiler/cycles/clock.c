/* A clock that an interrupt would drive: 100 ticks. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static unsigned char ticks = 40, seconds = 58, minutes = 59, hours = 23;

static void tick(void)
{
    if (++ticks < 50)
        return;
    ticks = 0;
    if (++seconds < 60)
        return;
    seconds = 0;
    if (++minutes < 60)
        return;
    minutes = 0;
    if (++hours == 24)
        hours = 0;
}

static void run(void)
{
    unsigned char n;

    for (n = 0; n < 100; n++)
        tick();
    add(ticks);
    add(seconds);
    add(minutes);
    add(hours);
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
