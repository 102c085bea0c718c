/* Timer 0 overflows every 1.024 ms; a struct keeps the time of day. RB0 is high in odd seconds, RA0 in odd minutes. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

struct time {
    unsigned char hours, minutes, seconds;
};

static struct time now = {23, 59, 58};
static volatile unsigned char due;
static unsigned int microseconds;

void interrupt tick(void)
{
    if (T0IF) {
        T0IF = 0;
        microseconds += 1024;
        if (microseconds >= 50000) {       /* keeps what is left: no error adds up */
            microseconds -= 50000;
            due++;
        }
    }
}

static void count(struct time *t)
{
    if (++t->seconds < 60)
        return;
    t->seconds = 0;
    if (++t->minutes < 60)
        return;
    t->minutes = 0;
    if (++t->hours == 24)
        t->hours = 0;
}

void main(void)
{
    TRISA = 0;
    TRISB = 0;
    PORTA = 0;
    PORTB = 0;
    OPTION_REG = 0xD1;                     /* clock, 1:4 */
    TMR0 = 0;
    T0IE = 1;
    GIE = 1;
    for (;;) {
        if (due >= 20) {
            due -= 20;
            count(&now);
            RB0 = now.seconds & 1;
            RA0 = now.minutes & 1;
            RB1 = now.hours == 0;
        }
    }
}
