// int_counter.c: each fall of RB0/INT interrupts and shows its number on RB4 to RB7.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

unsigned char count;

void __interrupt() fall(void)
{
    if (INTF) {
        INTF = 0;
        count++;
        PORTB = (unsigned char)(count << 4);
    }
}

void main(void)
{
    OPTION_REG = 0x00;
    PORTB = 0;
    TRISB = 0x01;
    INTCON = 0x90;
    while (1) {}
}
