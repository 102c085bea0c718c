#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000
unsigned char turns;
unsigned char twice(unsigned char value)
{
    PORTBbits.RB1 = 1;
    return value + value;
}
void main(void)
{
    unsigned char sum = 0;
    TRISB = 0x00;
    PORTB = 0;
    while (1) {
        turns++;
        sum = twice(turns);
        PORTB = sum;
        __delay_us(100);
    }
}
