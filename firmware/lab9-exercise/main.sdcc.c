/*
 * lab9-exercise: servo pulses for the PIC16F84 at 4 MHz (SDCC).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  vertical: 1500, 1602 us
 * RB1  horizontal: 1437, 1450, 1462, 1475, 1487, 1500, 1513, 1525, 1538, 1550, 1563 us
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

/* vertical 1500 us, horizontal 1437 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1437 us */
        wait(1434); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16498); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* vertical 1500 us, horizontal 1563 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1563 us */
        wait(1562);
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16370); nop(); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* vertical 1602 us, horizontal 1563 us */
void position_3(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1602 us */
        wait(1598); nop(); nop(); nop();
        PORTB = 0x00;   /* vertical low */
        wait(394); nop(); nop();
        PORTB = 0x02;   /* horizontal high for 1563 us */
        wait(1562);
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16370); nop(); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* vertical 1602 us, horizontal 1437 us */
void position_4(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1602 us */
        wait(1598); nop(); nop(); nop();
        PORTB = 0x00;   /* vertical low */
        wait(394); nop(); nop();
        PORTB = 0x02;   /* horizontal high for 1437 us */
        wait(1434); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16498); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xFC;
    wait(19986); nop(); nop(); nop();   /* all low for one frame */

    while (1) {

        /* vertical 1500 us, horizontal 1437 us, for 0.1 s */
        position_1(5);
        wait(54); nop(); nop(); nop();

        /* vertical 1500 us, horizontal 1450 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1450 us */
        wait(1446); nop(); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16546); nop();

        /* vertical 1500 us, horizontal 1462 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1462 us */
        wait(1458); nop(); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16534); nop();

        /* vertical 1500 us, horizontal 1475 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1475 us */
        wait(1474);
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16522);

        /* vertical 1500 us, horizontal 1487 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1487 us */
        wait(1486);
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16510);

        /* vertical 1500 us, horizontal 1500 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16494); nop(); nop(); nop();

        /* vertical 1500 us, horizontal 1513 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1513 us */
        wait(1510); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16482); nop(); nop();

        /* vertical 1500 us, horizontal 1525 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1525 us */
        wait(1522); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16470); nop(); nop();

        /* vertical 1500 us, horizontal 1538 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1538 us */
        wait(1534); nop(); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16458); nop();

        /* vertical 1500 us, horizontal 1550 us */
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1550 us */
        wait(1546); nop(); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16442); nop();

        /* vertical 1500 us, horizontal 1563 us, for 0.12 s */
        position_2(6);
        wait(50); nop(); nop(); nop();

        /* vertical 1602 us, horizontal 1563 us, for 0.1 s */
        position_3(5);
        wait(50); nop(); nop(); nop();

        /* vertical 1602 us, horizontal 1437 us, for 0.1 s */
        position_4(5);
        wait(50); nop();
    }
}
