/*
 * lab9-program: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  vertical: 1250, 1500 us
 * RB1  horizontal: 1250 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

/* vertical 90 deg: 1500 us, horizontal 0 deg: 1250 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1250 us */
        _delay(1249);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16686);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* vertical 0 deg: 1250 us, horizontal 0 deg: 1250 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1250 us */
        _delay(1249);
        PORTB = 0x00;   /* vertical low */
        _delay(748);
        PORTB = 0x02;   /* horizontal high for 1250 us */
        _delay(1249);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16686);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xFC;
    _delay(19990);   /* all low for one frame */

    while (1) {

        /* vertical 90 deg: 1500 us, horizontal 0 deg: 1250 us, for 0.4 s */
        position_1(20);
        _delay(53);

        /* vertical 0 deg: 1250 us, horizontal 0 deg: 1250 us, for 0.4 s */
        position_2(20);
        _delay(51);
    }
}
