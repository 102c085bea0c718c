// Bits: __bit variables, bool, bits of registers and of variables, portb.7, PORTBbits.
// expect: x == 0x81
// expect: y == 1
// expect: z == 2
// expect: n == 1
// expect: even == 0
// expect: odd == 1
#include <xc.h>
#include <stdbool.h>
unsigned char x, y, z, n, even, odd;
unsigned char at_even @ 0x22, at_odd @ 0x23;
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
  // a conversion to a bit keeps the lowest one, of an address too
  flag = (__bit)(unsigned char)&at_even;
  even = flag;
  flag = (__bit)(unsigned char)&at_odd;
  odd = flag;
}
