/*
 * omni-square: servo pulses for the PIC16F84 at 4 MHz (SDCC).
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
#include <pic14/pic16f84.h>

static __code unsigned int __at(_CONFIG) configuration = _FOSC_XT & _WDTE_OFF & _PWRTE_ON & _CP_OFF;
#define _XTAL_FREQ 4000000

/* No variable has a start value: in place of SDCC's start-up, which takes 160 words. */
void main(void);
void _sdcc_gsinit_startup(void)
{
    __asm
    goto    _main
    __endasm;
}

/* wait(n) takes n cycles: 14 and any number of fours more, up to 250 000. */
#define nop() __asm__("nop")
#define wait(cycles) \
    __asm__("movlw ((" #cycles ") - 14) / 1000 + 1\n movwf _waited\n" \
            " movlw ((" #cycles ") - 14) % 1000 / 4 + 1\n call _wait_loop")
unsigned char waited;

void wait_loop(void)
{
    __asm
wait_fours:
    addlw   0xFF
    btfss   STATUS, 2
    goto    wait_fours
    decfsz  _waited, F
    goto    wait_thousand
    goto    wait_over
wait_thousand:
    goto    $+1
    nop
    movlw   248
    goto    wait_fours
wait_over:
    __endasm;
}

/* wheel1 1583 us, wheel2 1417 us, wheel3 1500 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1583 us */
        wait(1582);
        PORTB = 0x00;   /* wheel1 low */
        wait(362); nop(); nop(); nop();
        PORTB = 0x02;   /* wheel2 high for 1417 us */
        wait(1414); nop(); nop();
        PORTB = 0x00;   /* wheel2 low */
        wait(530); nop();
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* wheel3 low */
        __asm__("clrwdt");
        wait(14534); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* wheel1 1500 us, wheel2 1500 us, wheel3 1500 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* wheel1 low */
        wait(446); nop(); nop();
        PORTB = 0x02;   /* wheel2 high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* wheel2 low */
        wait(446); nop(); nop();
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* wheel3 low */
        __asm__("clrwdt");
        wait(14534); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* wheel1 1452 us, wheel2 1452 us, wheel3 1595 us */
void position_3(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1452 us */
        wait(1450); nop();
        PORTB = 0x00;   /* wheel1 low */
        wait(494); nop(); nop();
        PORTB = 0x02;   /* wheel2 high for 1452 us */
        wait(1450); nop();
        PORTB = 0x00;   /* wheel2 low */
        wait(494); nop(); nop();
        PORTB = 0x04;   /* wheel3 high for 1595 us */
        wait(1594);
        PORTB = 0x00;   /* wheel3 low */
        __asm__("clrwdt");
        wait(14438); nop(); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* wheel1 1417 us, wheel2 1583 us, wheel3 1500 us */
void position_4(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1417 us */
        wait(1414); nop(); nop();
        PORTB = 0x00;   /* wheel1 low */
        wait(530); nop();
        PORTB = 0x02;   /* wheel2 high for 1583 us */
        wait(1582);
        PORTB = 0x00;   /* wheel2 low */
        wait(362); nop(); nop(); nop();
        PORTB = 0x04;   /* wheel3 high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* wheel3 low */
        __asm__("clrwdt");
        wait(14534); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* wheel1 1548 us, wheel2 1548 us, wheel3 1405 us */
void position_5(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* wheel1 high for 1548 us */
        wait(1546); nop();
        PORTB = 0x00;   /* wheel1 low */
        wait(398); nop(); nop();
        PORTB = 0x02;   /* wheel2 high for 1548 us */
        wait(1546); nop();
        PORTB = 0x00;   /* wheel2 low */
        wait(398); nop(); nop();
        PORTB = 0x04;   /* wheel3 high for 1405 us */
        wait(1402); nop(); nop();
        PORTB = 0x00;   /* wheel3 low */
        __asm__("clrwdt");
        wait(14630); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xF8;
    wait(19986); nop(); nop(); nop();   /* all low for one frame */

    while (1) {

        /* wheel1 1583 us, wheel2 1417 us, wheel3 1500 us, for 3 s */
        position_1(150);
        wait(50); nop(); nop(); nop();

        /* wheel1 1500 us, wheel2 1500 us, wheel3 1500 us, for 0.5 s */
        position_2(25);
        wait(50); nop(); nop(); nop();

        /* wheel1 1452 us, wheel2 1452 us, wheel3 1595 us, for 3 s */
        position_3(150);
        wait(50); nop(); nop(); nop();

        /* wheel1 1500 us, wheel2 1500 us, wheel3 1500 us, for 0.5 s */
        position_2(25);
        wait(50); nop(); nop(); nop();

        /* wheel1 1417 us, wheel2 1583 us, wheel3 1500 us, for 3 s */
        position_4(150);
        wait(50); nop(); nop(); nop();

        /* wheel1 1500 us, wheel2 1500 us, wheel3 1500 us, for 0.5 s */
        position_2(25);
        wait(50); nop(); nop(); nop();

        /* wheel1 1548 us, wheel2 1548 us, wheel3 1405 us, for 3 s */
        position_5(150);
        wait(50); nop(); nop(); nop();

        /* wheel1 1500 us, wheel2 1500 us, wheel3 1500 us, for 0.5 s */
        position_2(25);
        wait(50); nop();
    }
}
