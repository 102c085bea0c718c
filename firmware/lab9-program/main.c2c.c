/*
 * lab9-program: servo pulses for the PIC16F84 at 4 MHz (C2C).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  vertical: 1250, 1500 us
 * RB1  horizontal: 1250 us
 *
 * A frame takes 20000 us, an instruction cycle 1 us. Each delay is shorter than
 * the time in its comment by the cycles of the statements around it. The watchdog is off; where somebody
 * leaves it on, each frame feeds it.
 */
#pragma CLOCK_FREQ 4000000
/* XT, watchdog off, power-up timer on, no code protection: */
asm __config 0x3FF1

/* vertical 90 deg: 1500 us, horizontal 0 deg: 1250 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        delay_ms(1); delay_10us(49); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(49); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1250 us */
        delay_ms(1); delay_10us(24); delay_us(9);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(68); delay_us(6);   /* the rest of the frame */
        if (--frames == 0)
            return;
        delay_10us(5); delay_us(6);   /* as long as the path from one position to the next */
    }
}

/* vertical 0 deg: 1250 us, horizontal 0 deg: 1250 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1250 us */
        delay_ms(1); delay_10us(24); delay_us(9);
        PORTB = 0x00;   /* vertical low */
        delay_10us(74); delay_us(8);
        PORTB = 0x02;   /* horizontal high for 1250 us */
        delay_ms(1); delay_10us(24); delay_us(9);
        PORTB = 0x00;   /* horizontal low */
        clear_wdt();
        delay_ms(16); delay_10us(68); delay_us(6);   /* the rest of the frame */
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

        /* vertical 90 deg: 1500 us, horizontal 0 deg: 1250 us, for 0.4 s */
        position_1(20);
        delay_10us(5); delay_us(3);

        /* vertical 0 deg: 1250 us, horizontal 0 deg: 1250 us, for 0.4 s */
        position_2(20);
        delay_10us(5); delay_us(1);
    }
}
