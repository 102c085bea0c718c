// seconds.c: a clock in TMR0's interrupt, 250 cycles each; RB0 changes every second, RB1 every tenth of one.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

unsigned char ticks, hundredths, tenths;

void __interrupt() tick(void)
{
    if (T0IF) {
        TMR0 += 256 - 250 + 3;
        T0IF = 0;
        if (++ticks == 40) {
            ticks = 0;
            if (++hundredths == 10) {
                hundredths = 0;
                RB1 = !RB1;
                if (++tenths == 10) {
                    tenths = 0;
                    RB0 = !RB0;
                }
            }
        }
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
