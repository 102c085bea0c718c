/* A wheel with a light barrier on RB0: the interrupt counts turns; port A shows the count divided by four. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

volatile unsigned int turns;

void __interrupt() isr(void)
{
    if (INTE && INTF) {
        INTF = 0;
        turns++;
    }
}

unsigned int turns_now(void)
{
    unsigned int copy;

    di();
    copy = turns;
    ei();
    return copy;
}

void main(void)
{
    TRISA = 0b00000;
    TRISB = 0b00000001;
    PORTA = 0;
    INTEDG = 1;
    INTF = 0;
    INTE = 1;
    ei();
    while (1)
        PORTA = (turns_now() >> 2) & 0x0F;
}
