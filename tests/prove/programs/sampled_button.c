// sampled_button.c: TMR0 interrupts every 4 ms and reads the button on RB0; four equal reads count, and a press toggles RB7.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

volatile unsigned char reads = 0xFF, pressed;

void __interrupt() sample(void)
{
    if (T0IF) {
        T0IF = 0;
        TMR0 += 6;
        reads <<= 1;
        if (RB0)
            reads |= 1;
        if ((reads & 0x0F) == 0x00 && !pressed) {
            pressed = 1;
            RB7 = !RB7;
        } else if ((reads & 0x0F) == 0x0F) {
            pressed = 0;
        }
    }
}

void main(void)
{
    PORTB = 0;
    TRISB = 0x01;
    OPTION_REG = 0x03;                  // pull-ups; a prescaler of 1:16
    INTCON = 0xA0;
    while (1) {}
}
