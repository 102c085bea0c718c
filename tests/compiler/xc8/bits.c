// Bits: __bit variables, bool, bits of registers and of variables, portb.7, PORTBbits.
// expect: x == 0x81
// expect: y == 1
// expect: z == 2
// expect: n == 1
#include <xc.h>
#include <stdbool.h>
unsigned char x, y, z, n;
__bit flag;
bool ok;
void main(void) {
  TRISB = 0;
  flag = 1;
  if (flag) x.7 = 1;
  x.0 = flag;
  ok = x;
  y = ok;
  PORTBbits.RB1 = 1;
  RB2 = 0;
  z = PORTB;
  flag = !flag;
  n = !flag;
  STATUSbits.C = 0;
  if (CARRY) n = 9;
}
