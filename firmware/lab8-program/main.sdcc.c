/*
 * lab8-program: servo pulses for the PIC16F84 at 4 MHz (SDCC).
 * Generated from the job by servogen: change the job, not this file.
 *
 * RB0  arm: 1000, 2000 us
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

/* wait_long(n) takes 200 000 n + 5 cycles. */
#define wait_long(times) __asm__("movlw " #times "\n call _wait_long_loop")
unsigned char waited_long;

void wait_long_loop(void)
{
    __asm
    movwf   _waited_long
wait_again:
    movlw   200
    movwf   _waited
    movlw   246
    call    _wait_loop
    goto    $+1
    nop
    decfsz  _waited_long, F
    goto    wait_again
    __endasm;
}

/* arm 1000 us */
void position_1(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 1000 us */
        wait(998); nop();
        PORTB = 0x00;   /* arm low */
        __asm__("clrwdt");
        wait(18934); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

/* arm 2000 us */
void position_2(unsigned char frames)
{
    while (1) {
        PORTB = 0x01;   /* arm high for 2000 us */
        wait(1998); nop();
        PORTB = 0x00;   /* arm low */
        __asm__("clrwdt");
        wait(17934); nop(); nop();   /* the rest of the frame */
        if (--frames == 0)
            return;
        wait(54); nop(); nop();   /* as long as the path from one position to the next */
    }
}

void main(void)
{
    PORTB = 0x00;
    TRISB = 0xFE;
    wait(19986); nop(); nop();   /* all low for one frame */

    while (1) {

        /* arm 1000 us, for 2 s */
        position_1(100);
        wait(50); nop(); nop(); nop();

        /* 5 s without pulses */
        wait_long(24); wait(199994); nop();

        /* arm 2000 us, for 2 s */
        position_2(100);
        wait(50); nop();

        /* 5 s without pulses */
        wait_long(24); wait(199994); nop();
    }
}
