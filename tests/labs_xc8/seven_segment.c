/* Two digits on port B, one after the other every 5 ms; RA0 and RA1 choose the digit. Counts 00 to 59. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

const unsigned char digits[] = {0x3F, 0x06, 0x5B, 0x4F, 0x66, 0x6D, 0x7D, 0x07, 0x7F, 0x6F};

static void show(unsigned char segments, unsigned char digit)
{
    PORTA = 0;
    PORTB = segments;
    PORTA = (unsigned char)(1 << digit);
    __delay_ms(5);
}

void main(void)
{
    TRISA = 0;
    TRISB = 0;
    for (;;) {
        for (unsigned char n = 0; n < 60; n++) {
            for (unsigned char times = 0; times < 10; times++) {
                show(digits[n / 10], 1);
                show(digits[n % 10], 0);
            }
        }
    }
}
