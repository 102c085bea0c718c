/*
 * omni-square: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  wheel1: 1417, 1452, 1500, 1548, 1583 us
 * RB1  wheel2: 1417, 1452, 1500, 1548, 1583 us
 * RB2  wheel3: 1405, 1500, 1595 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

/* wheel1 124 deg/s: 1583 us, wheel2 -124 deg/s: 1417 us, wheel3 0 deg/s: 1500 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1583 us */
        _delay(1582);
        PORTB = 0x00;   /* wheel1 low */
        _delay(365);
        PORTB = 0x02;   /* wheel2 high for 1417 us */
        _delay(1416);
        PORTB = 0x00;   /* wheel2 low */
        _delay(531);
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* wheel3 low */
        CLRWDT();
        _delay(14536);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* wheel1 low */
        _delay(448);
        PORTB = 0x02;   /* wheel2 high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* wheel2 low */
        _delay(448);
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* wheel3 low */
        CLRWDT();
        _delay(14536);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* wheel1 -71.62 deg/s: 1452 us, wheel2 -71.62 deg/s: 1452 us, wheel3 143.2 deg/s: 1595 us */
void position_3(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1452 us */
        _delay(1451);
        PORTB = 0x00;   /* wheel1 low */
        _delay(496);
        PORTB = 0x02;   /* wheel2 high for 1452 us */
        _delay(1451);
        PORTB = 0x00;   /* wheel2 low */
        _delay(496);
        PORTB = 0x04;   /* wheel3 high for 1595 us */
        _delay(1594);
        PORTB = 0x00;   /* wheel3 low */
        CLRWDT();
        _delay(14441);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* wheel1 -124 deg/s: 1417 us, wheel2 124 deg/s: 1583 us, wheel3 0 deg/s: 1500 us */
void position_4(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1417 us */
        _delay(1416);
        PORTB = 0x00;   /* wheel1 low */
        _delay(531);
        PORTB = 0x02;   /* wheel2 high for 1583 us */
        _delay(1582);
        PORTB = 0x00;   /* wheel2 low */
        _delay(365);
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* wheel3 low */
        CLRWDT();
        _delay(14536);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* wheel1 71.62 deg/s: 1548 us, wheel2 71.62 deg/s: 1548 us, wheel3 -143.2 deg/s: 1405 us */
void position_5(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1548 us */
        _delay(1547);
        PORTB = 0x00;   /* wheel1 low */
        _delay(400);
        PORTB = 0x02;   /* wheel2 high for 1548 us */
        _delay(1547);
        PORTB = 0x00;   /* wheel2 low */
        _delay(400);
        PORTB = 0x04;   /* wheel3 high for 1405 us */
        _delay(1404);
        PORTB = 0x00;   /* wheel3 low */
        CLRWDT();
        _delay(14631);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xF8;
    _delay(19990);   /* all low for one frame */

    while (1) {

        /* wheel1 124 deg/s: 1583 us, wheel2 -124 deg/s: 1417 us, wheel3 0 deg/s: 1500 us, for 3 s */
        position_1(150);
        _delay(53);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        _delay(53);

        /* wheel1 -71.62 deg/s: 1452 us, wheel2 -71.62 deg/s: 1452 us, wheel3 143.2 deg/s: 1595 us, for 3 s */
        position_3(150);
        _delay(53);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        _delay(53);

        /* wheel1 -124 deg/s: 1417 us, wheel2 124 deg/s: 1583 us, wheel3 0 deg/s: 1500 us, for 3 s */
        position_4(150);
        _delay(53);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        _delay(53);

        /* wheel1 71.62 deg/s: 1548 us, wheel2 71.62 deg/s: 1548 us, wheel3 -143.2 deg/s: 1405 us, for 3 s */
        position_5(150);
        _delay(53);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        _delay(51);
    }
}
