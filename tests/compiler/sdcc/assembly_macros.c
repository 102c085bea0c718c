// expect: a == 0x0C
#include <pic14/pic16f84a.h>
#define LED 3
#define NEXT (LED - 1)
unsigned char a;
void main(void) {
  a = 0;
  __asm
    bsf _a, LED
  __endasm;
  __asm__("bsf _a, NEXT");
}
