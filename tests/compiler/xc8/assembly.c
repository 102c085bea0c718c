// #asm to #endasm with C's variables and parameters; the instructions that have no C.
// expect: a == 5
// expect: b == 9
// expect: w == 0x0600
#include <xc.h>
unsigned char a, b;
unsigned int w;
void copy(unsigned char x) {
#asm
  movf _x_copy, w
  movwf _b ; kept
#endasm
}
void main(void) {
#asm
  movlw 5
  movwf _a
  nop
#endasm
  CLRWDT();
  asm("movlw 6\n movwf _w+1");
  copy(9);
}
