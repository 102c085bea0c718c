// dim_four.c: four lamps on RB0 to RB3, each with its own share of 16 ticks of TMR0's interrupt.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

unsigned char duty[4] = {1, 4, 8, 12}, now;

void __interrupt() tick(void)
{
    if (T0IF) {
        T0IF = 0;
        now = (now + 1) & 15;
        if (now == 0)
            PORTB |= 0x0F;
        if (now == duty[0])
            RB0 = 0;
        if (now == duty[1])
            RB1 = 0;
        if (now == duty[2])
            RB2 = 0;
        if (now == duty[3])
            RB3 = 0;
    }
}

void main(void)
{
    PORTB = 0;
    TRISB = 0;
    OPTION_REG = 0x88;
    INTCON = 0xA0;
    while (1) {}
}
