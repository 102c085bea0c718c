/*
 * lab8-program: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  arm: 1000, 2000 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

/* arm 0 deg: 1000 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 1000 us */
        _delay(999);
        PORTB = 0x00;   /* arm low */
        CLRWDT();
        _delay(18936);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* arm 180 deg: 2000 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 2000 us */
        _delay(1999);
        PORTB = 0x00;   /* arm low */
        CLRWDT();
        _delay(17936);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xFE;
    _delay(19990);   /* all low for one frame */

    while (1) {

        /* arm 0 deg: 1000 us, for 2 s */
        position_1(100);
        _delay(53);

        /* 5 s without pulses */
        _delay(5000000);

        /* arm 180 deg: 2000 us, for 2 s */
        position_2(100);
        _delay(51);

        /* 5 s without pulses */
        _delay(5000000);
    }
}
