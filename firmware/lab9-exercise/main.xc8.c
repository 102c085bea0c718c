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

/* Waits `cycles`, and as many as its statements take: in turns of 8, and of 9 for those left over. */
void wait_8(unsigned int cycles)
{
    unsigned char turns, longer;

    longer = cycles & 7;
    turns = (cycles >> 3) - longer;
    longer++;
    do {
        _delay(5);
    } while (--turns);
    do {
        _delay(6);
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
        wait_8(vertical_width[row] - 160); _delay(108);
        PORTB = 0x00;   /* vertical low */
        wait_8(1666 - vertical_width[row]); _delay(280);
        PORTB = 0x02;   /* horizontal high */
        wait_8(horizontal_width[row] - 160); _delay(109);
        PORTB = 0x00;   /* horizontal low */
        wait_8(1627 - horizontal_width[row]);
        CLRWDT();
        row++;
        _delay(16149);   /* the rest of the frame */
        if (--rows == 0)
            return;
        _delay(163);   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xFC;
    _delay(19989);   /* all low for one frame */

    while (1) {

        /* 30 frames of the table, in 0.6 s */
        move_1(0, 30);
        _delay(157);
    }
}
