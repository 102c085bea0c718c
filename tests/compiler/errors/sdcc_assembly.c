// dialect: sdcc
#include <pic14/pic16f84.h>

void main(void)
{
    // error: assembly: the literal (1500 + 14) / 4 is 378, outside 0 to 255
    __asm__("movlw (1500 + 14) / 4");
}
