// expect: a == 0x0C
#include <xc.h>
#define LED 3
#define NEXT (LED - 1)
unsigned char a;
void main(void) {
  a = 0;
#asm
    bsf _a, LED
#endasm
  asm("nop\n"
      "bsf _a, NEXT");
}
