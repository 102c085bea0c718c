/*
 * lab9-program: servo pulses for the PIC16F84 at 4 MHz (SDCC).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  vertical: 1250, 1500 us
 * RB1  horizontal: 1250 us
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

/* vertical 1500 us, horizontal 1250 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1500 us */
        wait(1498); nop();
        PORTB = 0x00;   /* vertical low */
        wait(498);
        PORTB = 0x02;   /* horizontal high for 1250 us */
        wait(1246); nop(); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16686);   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* vertical 1250 us, horizontal 1250 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* vertical high for 1250 us */
        wait(1246); nop(); nop(); nop();
        PORTB = 0x00;   /* vertical low */
        wait(746); nop(); nop();
        PORTB = 0x02;   /* horizontal high for 1250 us */
        wait(1246); nop(); nop(); nop();
        PORTB = 0x00;   /* horizontal low */
        __asm__("clrwdt");
        wait(16686);   /* the rest of the frame */
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

        /* vertical 1500 us, horizontal 1250 us, for 0.4 s */
        position_1(20);
        wait(50); nop(); nop(); nop();

        /* vertical 1250 us, horizontal 1250 us, for 0.4 s */
        position_2(20);
        wait(50); nop();
    }
}
