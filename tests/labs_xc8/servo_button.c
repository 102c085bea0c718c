/* Two buttons move a servo on RB0 in steps of 10 us between 1 and 2 ms; 50 pulses a second. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

#include <stdint.h>

static uint8_t angle = 50;                 /* in steps: 0 is 1 ms, 100 is 2 ms */

static void pulse(void)
{
    uint8_t n;

    RB0 = 1;
    __delay_us(990);
    for (n = 0; n != angle; n++)
        _delay(4);
    RB0 = 0;
}

void main(void)
{
    TRISA = 0x1F;
    PORTB = 0;
    TRISB = 0xFE;
    while (1) {
        pulse();
        __delay_ms(18);
        if (!RA0 && angle < 100)
            angle++;
        else if (!RA1 && angle > 0)
            angle--;
    }
}
