/*
 * lab9-exercise: servo pulses for the PIC16F84 at 4 MHz (C2C).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  vertical: 1500, 1602 us
 * RB1  horizontal: 1437, 1450, 1462, 1475, 1487, 1500, 1513, 1525, 1538, 1550, 1563 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#pragma CLOCK_FREQ 4000000
/* XT, watchdog off, power-up timer on, no code protection: */
asm __config 0x3FF1

/* vertical 90 deg: 1500 us, horizontal 67.38 deg: 1437 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1437 us */
        delay_ms(1); delay_10us(43); delay_us(6);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(49); delay_us(9);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* vertical 90 deg: 1500 us, horizontal 112.6 deg: 1563 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1563 us */
        delay_ms(1); delay_10us(56); delay_us(2);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(37); delay_us(3);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* vertical 126.9 deg: 1602 us, horizontal 112.6 deg: 1563 us */
void position_3(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1602 us */
        delay_ms(1); delay_10us(60); delay_us(1);
        PORTB = 0x00;   /* vertical low */
        delay_10us(39); delay_us(6);
        PORTB = 0x02;   /* horizontal high for 1563 us */
        delay_ms(1); delay_10us(56); delay_us(2);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(37); delay_us(3);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* vertical 126.9 deg: 1602 us, horizontal 67.38 deg: 1437 us */
void position_4(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1602 us */
        delay_ms(1); delay_10us(60); delay_us(1);
        PORTB = 0x00;   /* vertical low */
        delay_10us(39); delay_us(6);
        PORTB = 0x02;   /* horizontal high for 1437 us */
        delay_ms(1); delay_10us(43); delay_us(6);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(49); delay_us(9);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    set_bit(STATUS, RP0);
    TRISB = 0xFC;
    clear_bit(STATUS, RP0);
    delay_ms(19); delay_10us(99);   /* all low for one frame */

    while (1) {

        /* vertical 90 deg: 1500 us, horizontal 67.38 deg: 1437 us, for 0.1 s */
        position_1(5);
        delay_10us(5); delay_us(7);

        /* vertical 90 deg: 1500 us, horizontal 71.9 deg: 1450 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1450 us */
        delay_ms(1); delay_10us(44); delay_us(9);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(54); delay_us(7);

        /* vertical 90 deg: 1500 us, horizontal 76.43 deg: 1462 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1462 us */
        delay_ms(1); delay_10us(46); delay_us(1);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(53); delay_us(5);

        /* vertical 90 deg: 1500 us, horizontal 80.95 deg: 1475 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1475 us */
        delay_ms(1); delay_10us(47); delay_us(4);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(52); delay_us(2);

        /* vertical 90 deg: 1500 us, horizontal 85.48 deg: 1487 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1487 us */
        delay_ms(1); delay_10us(48); delay_us(6);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(51);

        /* vertical 90 deg: 1500 us, horizontal 90 deg: 1500 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(49); delay_us(7);

        /* vertical 90 deg: 1500 us, horizontal 94.52 deg: 1513 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1513 us */
        delay_ms(1); delay_10us(51); delay_us(2);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(48); delay_us(4);

        /* vertical 90 deg: 1500 us, horizontal 99.05 deg: 1525 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1525 us */
        delay_ms(1); delay_10us(52); delay_us(4);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(47); delay_us(2);

        /* vertical 90 deg: 1500 us, horizontal 103.6 deg: 1538 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1538 us */
        delay_ms(1); delay_10us(53); delay_us(7);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(45); delay_us(9);

        /* vertical 90 deg: 1500 us, horizontal 108.1 deg: 1550 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1550 us */
        delay_ms(1); delay_10us(54); delay_us(9);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(44); delay_us(3);

        /* vertical 90 deg: 1500 us, horizontal 112.6 deg: 1563 us, for 0.12 s */
        position_2(6);
        delay_10us(5); delay_us(3);

        /* vertical 126.9 deg: 1602 us, horizontal 112.6 deg: 1563 us, for 0.1 s */
        position_3(5);
        delay_10us(5); delay_us(3);

        /* vertical 126.9 deg: 1602 us, horizontal 67.38 deg: 1437 us, for 0.1 s */
        position_4(5);
        delay_10us(5); delay_us(1);
    }
}
