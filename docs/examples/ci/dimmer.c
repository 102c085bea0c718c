// dimmer.c: a lamp on RB3, at a quarter or at three quarters of its light; a press of RB0 changes between them.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

#define READS 10                        // the button counts as pressed after so many equal reads, one in 2 ms

void main(void)
{
    unsigned char bright = 0, pressed = 0;

    OPTION_REGbits.nRBPU = 0;
    PORTB = 0;
    TRISB = 0x01;
    while (1) {
        RB3 = 1;
        __delay_us(500);
        if (bright)
            __delay_us(1000);
        RB3 = 0;
        __delay_us(400);
        if (!bright)
            __delay_us(1000);
        if (RB0)
            pressed = 0;
        else if (pressed < READS && ++pressed == READS)
            bright = !bright;
    }
}
