// half_steps.c: a stepper motor on RB0 to RB3 in half steps, from 20 ms a step to 4 ms; RB7 low stops it.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

const unsigned char STEPS[8] = {0x01, 0x03, 0x02, 0x06, 0x04, 0x0C, 0x08, 0x09};

void main(void)
{
    unsigned char step = 0, period = 20, n;

    OPTION_REGbits.nRBPU = 0;
    PORTB = 0;
    TRISB = 0x80;
    while (1) {
        if (!RB7) {
            period = 20;
            continue;
        }
        PORTB = STEPS[step];
        step = (step + 1) & 7;
        for (n = 0; n < period; n++)
            __delay_ms(1);
        if (period > 4)
            period--;
    }
}
