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

/* Waits `cycles`, and as many as its statements take: in turns of 8, and of 9 for those left over. */
void wait_8(unsigned int cycles)
{
    unsigned char turns, longer;

    longer = cycles & 7;
    turns = (cycles >> 3) - longer;
    longer++;
    do {
        delay_us(5);
    } while (--turns);
    do {
        delay_us(6);
    } while (--longer);
}

/* Widths of vertical in cycles, a frame each. */
const unsigned int vertical_width[] = {
    1500, 1500, 1500, 1500, 1500,   /* 90 deg, foot 25, 60, -100 mm */
    1500, 1500, 1500, 1500, 1500, 1500, 1500, 1500, 1500,   /* 90 deg */
    1500, 1500, 1500, 1500, 1500, 1500,   /* 90 deg, foot -25, 60, -100 mm */
    1602, 1602, 1602, 1602, 1602,   /* 126.9 deg, foot -47.15, 50.77, -92 mm */
    1602, 1602, 1602, 1602, 1602   /* 126.9 deg, foot 2.85, 69.23, -92 mm */
};

/* Widths of horizontal in cycles, a frame each. */
const unsigned int horizontal_width[] = {
    1437, 1437, 1437, 1437, 1437,   /* 67.38 deg, foot 25, 60, -100 mm */
    1450, 1462, 1475, 1487, 1500, 1513, 1525, 1538, 1550,   /* 71.9 deg to 108.1 deg */
    1563, 1563, 1563, 1563, 1563, 1563,   /* 112.6 deg, foot -25, 60, -100 mm */
    1563, 1563, 1563, 1563, 1563,   /* 112.6 deg, foot -47.15, 50.77, -92 mm */
    1437, 1437, 1437, 1437, 1437   /* 67.38 deg, foot 2.85, 69.23, -92 mm */
};

/*
 * Plays rows of the table, a frame each. A pulse is as long as its width: 160 cycles of it are statements and
 * the delay behind them. What is left of the longest pulse is waited after it, so that each row takes as long.
 */
void move_1(unsigned char row, unsigned char rows)
{
    while (1) {
        PORTB = 0x01;   /* vertical high */
        wait_8(vertical_width[row] - 160); delay_10us(10); delay_us(8);
        PORTB = 0x00;   /* vertical low */
        wait_8(1666 - vertical_width[row]); delay_10us(28);
        PORTB = 0x02;   /* horizontal high */
        wait_8(horizontal_width[row] - 160); delay_10us(10); delay_us(9);
        PORTB = 0x00;   /* horizontal low */
        wait_8(1627 - horizontal_width[row]);
        clear_wdt();
        row++;
        delay_ms(16); delay_10us(14); delay_us(9);   /* the rest of the frame */
        if (--rows == 0)
            return;
        delay_10us(16); delay_us(3);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    set_bit(STATUS, RP0);
    TRISB = 0xFC;
    clear_bit(STATUS, RP0);
    delay_ms(19); delay_10us(98); delay_us(9);   /* all low for one frame */

    while (1) {

        /* 30 frames of the table, in 0.6 s */
        move_1(0, 30);
        delay_10us(15); delay_us(7);
    }
}
