// float of 32 bits, and what of <math.h> a program of SDCC finds.
// expect: down == 0xC0400000
// expect: up == 0x40400000
// expect: same == 0x4B800001
// expect: zero == 0x80000000
// expect: size == 4
#include <pic14/pic16f84a.h>
#include <math.h>
float down, up, same, zero, x = -2.125;
unsigned char size;
void main(void) {
  size = sizeof(double);
  down = floorf(x);
  up = ceilf(-x);
  x = 16777218;
  same = floorf(x);
  x = 0;
  zero = ceilf(-x);
  while (1);
}
