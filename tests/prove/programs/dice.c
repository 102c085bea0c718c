// dice.c: while the button on RB7 is pressed the die on RB0 to RB2 rolls; let go, it shows 1 to 6.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

void main(void)
{
    unsigned char eye = 1;

    OPTION_REGbits.nRBPU = 0;
    PORTB = 1;
    TRISB = 0xF8;
    while (1) {
        while (!RB7) {
            if (++eye > 6)
                eye = 1;
        }
        PORTB = eye;
    }
}
