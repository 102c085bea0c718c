/*
 * lab9-exercise: servo pulses for the PIC16F84 at 4 MHz (XC8).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  vertical: 1500, 1602 us
 * RB1  horizontal: 1437, 1450, 1462, 1475, 1487, 1500, 1513, 1525, 1538, 1550, 1563 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#include <xc.h>

#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

/* vertical 90 deg: 1500 us, horizontal 67.38 deg: 1437 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1437 us */
        _delay(1436);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16499);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* vertical 90 deg: 1500 us, horizontal 112.6 deg: 1563 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1563 us */
        _delay(1562);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16373);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* vertical 126.9 deg: 1602 us, horizontal 112.6 deg: 1563 us */
void position_3(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1602 us */
        _delay(1601);
        PORTB = 0x00;   /* vertical low */
        _delay(396);
        PORTB = 0x02;   /* horizontal high for 1563 us */
        _delay(1562);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16373);   /* the rest of the frame */
        if (--frames == 0)
            return;
        _delay(56);   /* as long as the path from one position to the next */
    }
}

/* vertical 126.9 deg: 1602 us, horizontal 67.38 deg: 1437 us */
void position_4(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1602 us */
        _delay(1601);
        PORTB = 0x00;   /* vertical low */
        _delay(396);
        PORTB = 0x02;   /* horizontal high for 1437 us */
        _delay(1436);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16499);   /* the rest of the frame */
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

        /* vertical 90 deg: 1500 us, horizontal 67.38 deg: 1437 us, for 0.1 s */
        position_1(5);
        _delay(57);

        /* vertical 90 deg: 1500 us, horizontal 71.9 deg: 1450 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1450 us */
        _delay(1449);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16547);

        /* vertical 90 deg: 1500 us, horizontal 76.43 deg: 1462 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1462 us */
        _delay(1461);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16535);

        /* vertical 90 deg: 1500 us, horizontal 80.95 deg: 1475 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1475 us */
        _delay(1474);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16522);

        /* vertical 90 deg: 1500 us, horizontal 85.48 deg: 1487 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1487 us */
        _delay(1486);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16510);

        /* vertical 90 deg: 1500 us, horizontal 90 deg: 1500 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16497);

        /* vertical 90 deg: 1500 us, horizontal 94.52 deg: 1513 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1513 us */
        _delay(1512);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16484);

        /* vertical 90 deg: 1500 us, horizontal 99.05 deg: 1525 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1525 us */
        _delay(1524);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16472);

        /* vertical 90 deg: 1500 us, horizontal 103.6 deg: 1538 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1538 us */
        _delay(1537);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16459);

        /* vertical 90 deg: 1500 us, horizontal 108.1 deg: 1550 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        _delay(1499);
        PORTB = 0x00;   /* vertical low */
        _delay(498);
        PORTB = 0x02;   /* horizontal high for 1550 us */
        _delay(1549);
        PORTB = 0x00;   /* horizontal low */
        CLRWDT();
        _delay(16443);

        /* vertical 90 deg: 1500 us, horizontal 112.6 deg: 1563 us, for 0.12 s */
        position_2(6);
        _delay(53);

        /* vertical 126.9 deg: 1602 us, horizontal 112.6 deg: 1563 us, for 0.1 s */
        position_3(5);
        _delay(53);

        /* vertical 126.9 deg: 1602 us, horizontal 67.38 deg: 1437 us, for 0.1 s */
        position_4(5);
        _delay(51);
    }
}
