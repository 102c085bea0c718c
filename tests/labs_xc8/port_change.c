/* A rotary encoder on RB4 and RB5: each change is decoded by a table; the position is shown on RB0 to RB3. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

const signed char moves[16] = {0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0};

volatile signed char position;
unsigned char before;

void __interrupt() isr(void)
{
    if (INTCONbits.RBIF) {
        unsigned char now = (PORTB >> 4) & 3;
        INTCONbits.RBIF = 0;
        position += moves[before << 2 | now];
        before = now;
    }
}

void main(void)
{
    unsigned char shown = 0;

    PORTB = 0;
    TRISB = 0xF0;
    before = (PORTB >> 4) & 3;
    RBIF = 0;
    RBIE = 1;
    GIE = 1;
    while (1) {
        unsigned char now = (unsigned char)position & 0x0F;
        if (now != shown) {
            shown = now;
            PORTB = now;
        }
    }
}
