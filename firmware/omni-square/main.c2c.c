/*
 * omni-square: servo pulses for the PIC16F84 at 4 MHz (C2C).
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
#pragma CLOCK_FREQ 4000000
/* XT, watchdog off, power-up timer on, no code protection: */
asm __config 0x3FF1

/* wheel1 124 deg/s: 1583 us, wheel2 -124 deg/s: 1417 us, wheel3 0 deg/s: 1500 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1583 us */
        delay_ms(1); delay_10us(58); delay_us(2);
        PORTB = 0x00;   /* wheel1 low */
        delay_10us(36); delay_us(5);
        PORTB = 0x02;   /* wheel2 high for 1417 us */
        delay_ms(1); delay_10us(41); delay_us(6);
        PORTB = 0x00;   /* wheel2 low */
        delay_10us(53); delay_us(1);
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* wheel3 low */
        clear_wdt();
        delay_ms(14); delay_10us(53); delay_us(6);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* wheel1 low */
        delay_10us(44); delay_us(8);
        PORTB = 0x02;   /* wheel2 high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* wheel2 low */
        delay_10us(44); delay_us(8);
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* wheel3 low */
        clear_wdt();
        delay_ms(14); delay_10us(53); delay_us(6);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* wheel1 -71.62 deg/s: 1452 us, wheel2 -71.62 deg/s: 1452 us, wheel3 143.2 deg/s: 1595 us */
void position_3(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1452 us */
        delay_ms(1); delay_10us(45); delay_us(1);
        PORTB = 0x00;   /* wheel1 low */
        delay_10us(49); delay_us(6);
        PORTB = 0x02;   /* wheel2 high for 1452 us */
        delay_ms(1); delay_10us(45); delay_us(1);
        PORTB = 0x00;   /* wheel2 low */
        delay_10us(49); delay_us(6);
        PORTB = 0x04;   /* wheel3 high for 1595 us */
        delay_ms(1); delay_10us(59); delay_us(4);
        PORTB = 0x00;   /* wheel3 low */
        clear_wdt();
        delay_ms(14); delay_10us(44); delay_us(1);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* wheel1 -124 deg/s: 1417 us, wheel2 124 deg/s: 1583 us, wheel3 0 deg/s: 1500 us */
void position_4(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1417 us */
        delay_ms(1); delay_10us(41); delay_us(6);
        PORTB = 0x00;   /* wheel1 low */
        delay_10us(53); delay_us(1);
        PORTB = 0x02;   /* wheel2 high for 1583 us */
        delay_ms(1); delay_10us(58); delay_us(2);
        PORTB = 0x00;   /* wheel2 low */
        delay_10us(36); delay_us(5);
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* wheel3 low */
        clear_wdt();
        delay_ms(14); delay_10us(53); delay_us(6);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* wheel1 71.62 deg/s: 1548 us, wheel2 71.62 deg/s: 1548 us, wheel3 -143.2 deg/s: 1405 us */
void position_5(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1548 us */
        delay_ms(1); delay_10us(54); delay_us(7);
        PORTB = 0x00;   /* wheel1 low */
        delay_10us(40);
        PORTB = 0x02;   /* wheel2 high for 1548 us */
        delay_ms(1); delay_10us(54); delay_us(7);
        PORTB = 0x00;   /* wheel2 low */
        delay_10us(40);
        PORTB = 0x04;   /* wheel3 high for 1405 us */
        delay_ms(1); delay_10us(40); delay_us(4);
        PORTB = 0x00;   /* wheel3 low */
        clear_wdt();
        delay_ms(14); delay_10us(63); delay_us(1);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    set_bit(STATUS, RP0);
    TRISB = 0xF8;
    clear_bit(STATUS, RP0);
    delay_ms(19); delay_10us(99);   /* all low for one frame */

    while (1) {

        /* wheel1 124 deg/s: 1583 us, wheel2 -124 deg/s: 1417 us, wheel3 0 deg/s: 1500 us, for 3 s */
        position_1(150);
        delay_10us(5); delay_us(3);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        delay_10us(5); delay_us(3);

        /* wheel1 -71.62 deg/s: 1452 us, wheel2 -71.62 deg/s: 1452 us, wheel3 143.2 deg/s: 1595 us, for 3 s */
        position_3(150);
        delay_10us(5); delay_us(3);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        delay_10us(5); delay_us(3);

        /* wheel1 -124 deg/s: 1417 us, wheel2 124 deg/s: 1583 us, wheel3 0 deg/s: 1500 us, for 3 s */
        position_4(150);
        delay_10us(5); delay_us(3);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        delay_10us(5); delay_us(3);

        /* wheel1 71.62 deg/s: 1548 us, wheel2 71.62 deg/s: 1548 us, wheel3 -143.2 deg/s: 1405 us, for 3 s */
        position_5(150);
        delay_10us(5); delay_us(3);

        /* wheel1 0 deg/s: 1500 us, wheel2 0 deg/s: 1500 us, wheel3 0 deg/s: 1500 us, for 0.5 s */
        position_2(25);
        delay_10us(5); delay_us(1);
    }
}
