// An interrupt as SDCC has it: behind the parameters.
// expect: seen == 1
#include <pic14/pic16f84.h>

volatile unsigned char seen;

void handler(void) __interrupt(0)
{
    T0IF = 0;
    T0IE = 0;
    seen++;
}

void main(void)
{
    OPTION_REG = 0x80;
    T0IE = 1;
    GIE = 1;
    while (!seen)
        ;
}
