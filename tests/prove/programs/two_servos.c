// two_servos.c: pulses of 1 ms on RB0 and then of 2 ms on RB1, every 20 ms, by TMR0's interrupt.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

unsigned char slot;

void __interrupt() next(void)
{
    if (T0IF) {
        T0IF = 0;
        TMR0 = (unsigned char)(256 - 125);      // 125 * 8 cycles
        slot++;
        if (slot == 20)
            slot = 0;
        RB0 = slot == 0;
        RB1 = slot == 1 || slot == 2;
    }
}

void main(void)
{
    PORTB = 0;
    TRISB = 0;
    OPTION_REG = 0x82;
    INTCON = 0xA0;
    while (1) {}
}
