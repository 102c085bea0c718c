/*
 * lab8-program: servo pulses for the PIC16F84 at 4 MHz (C2C).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  arm: 1000, 2000 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#pragma CLOCK_FREQ 4000000
/* XT, watchdog off, power-up timer on, no code protection: */
asm __config 0x3FF1

/* arm 0 deg: 1000 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 1000 us */
        delay_10us(99); delay_us(9);
        PORTB = 0x00;   /* arm low */
        clear_wdt();
        delay_ms(18); delay_10us(93); delay_us(6);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* arm 180 deg: 2000 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 2000 us */
        delay_ms(1); delay_10us(99); delay_us(9);
        PORTB = 0x00;   /* arm low */
        clear_wdt();
        delay_ms(17); delay_10us(93); delay_us(6);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    set_bit(STATUS, RP0);
    TRISB = 0xFE;
    clear_bit(STATUS, RP0);
    delay_ms(19); delay_10us(99);   /* all low for one frame */

    while (1) {

        /* arm 0 deg: 1000 us, for 2 s */
        position_1(100);
        delay_10us(5); delay_us(3);

        /* 5 s without pulses */
        delay_s(5);

        /* arm 180 deg: 2000 us, for 2 s */
        position_2(100);
        delay_10us(5); delay_us(1);

        /* 5 s without pulses */
        delay_s(5);
    }
}
