// ranger.c: an ultrasonic sensor, trigger RB0, echo RA0; the lamp on RB1 tells that something is nearer than 50 cm.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

void main(void)
{
    unsigned char tens;

    PORTB = 0;
    TRISB = 0;
    while (1) {
        RB0 = 1;
        __delay_us(10);
        RB0 = 0;
        for (tens = 0; !RA0 && tens < 250; tens++) {}
        for (tens = 0; RA0 && tens < 250; tens++)
            __delay_us(20);
        RB1 = tens < 125;
        __delay_ms(50);
    }
}
