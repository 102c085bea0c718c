/*
 * lab8-exercise: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  arm: 1167, 1500, 1667 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

/* arm 30 deg: 1167 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 1167 us */
        _delay(1166);
        PORTB = 0x00;   /* arm low */
        CLRWDT();
        _delay(18769);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* arm 90 deg: 1500 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* arm low */
        CLRWDT();
        _delay(18436);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* arm 120 deg: 1667 us */
void position_3(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 1667 us */
        _delay(1666);
        PORTB = 0x00;   /* arm low */
        CLRWDT();
        _delay(18269);   /* the rest of the frame */
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

        /* arm 30 deg: 1167 us, for 2 s */
        position_1(100);
        _delay(53);

        /* arm 90 deg: 1500 us, for 5 s */
        position_2(250);
        _delay(53);

        /* arm 120 deg: 1667 us, for 3 s */
        position_3(150);
        _delay(51);
    }
}
