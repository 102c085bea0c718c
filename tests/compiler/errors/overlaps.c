// dialect: xc8
#include <xc.h>
const unsigned char list[] __at(0x100) = {1, 2, 3};
// error: 'f' at 0x102 overlaps 'list', which ends at 0x102
void f(void) @ 0x102 { PORTB = list[0]; }
void main(void) {
  TRISB = 0;
  f();
}
