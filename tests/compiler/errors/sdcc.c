// dialect: sdcc
#include <pic14/pic16f84.h>

// error: the configuration word at 0x2007 is a constant of 16 bits
static __code unsigned char __at(0x2007) configuration = 0xF1;
unsigned char x;

void main(void)
{
    // error: '_delay' belongs to the XC8 dialect
    _delay(10);
    // error: 'delay_ms' belongs to the C2C dialect
    delay_ms(10);
    x = 1;
}
