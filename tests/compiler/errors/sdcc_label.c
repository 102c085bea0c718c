// dialect: sdcc
#include <pic14/pic16f84.h>

void main(void)
{
    // error: assembly: there is no label '_nobody'
    __asm__("call _nobody");
}
