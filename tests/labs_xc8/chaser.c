/* Eight LEDs on port B: the light runs to the left; the switch on RA0 turns it round. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

void main(void)
{
    unsigned char led = 1;

    TRISA = 0x1F;
    TRISB = 0x00;
    PORTB = led;
    while (1) {
        __delay_ms(50);
        if (PORTAbits.RA0) {
            led <<= 1;
            if (led == 0)
                led = 1;
        } else {
            led >>= 1;
            if (!led)
                led = 0x80;
        }
        PORTB = led;
    }
}
