// encoder.c: an encoder on RA0 and RA1 sets a number from 0 to 15, which port B shows.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

void main(void)
{
    unsigned char number = 0, before = 1, now;

    PORTB = 0;
    TRISB = 0;
    while (1) {
        now = RA0;
        if (now && !before) {
            if (RA1) {
                if (number < 15)
                    number++;
            } else if (number > 0) {
                number--;
            }
        }
        before = now;
        PORTB = number;
        __delay_us(500);
    }
}
