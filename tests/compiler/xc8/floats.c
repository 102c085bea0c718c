// float and double of 24 bits: a sign, 8 bits of exponent plus 127, and 15 bits of mantissa behind a hidden 1. What
// the bytes must be is worked out by hand: 3.5 is 1.75 × 2, the exponent is 128, the mantissa 0x6000.
// expect: size == 33
// expect: sum == 0x406000
// expect: odd == 0x488000
// expect: whole == -7
// expect: byte == 200
// expect: picked == 0x420000
// expect: counted == 0x404000
// expect: before == 0x400000
// expect: shifted == 15
// expect: mixed == 7
// expect: called == 0x417000
// expect: absolute == 0x3FC000
// expect: chain == 0x40E000
#include <xc.h>
#include <math.h>
unsigned char size, byte, shifted = 3;
float one = 1;
double sum, odd, picked, counted, before, called, absolute, chain;
int whole, mixed = 5;
float twice(float x, unsigned char n) { return x * n; }
float (*function)(float, unsigned char) = twice;
void main(void) {
  double local = -7.9;
  size = sizeof(float) + 10 * sizeof(double);
  sum = one + 2.5;
  odd = (one - .5) * 524287;  // half of 0x7FFFF: a tie between the mantissas 0x7FFF and the even 0x8000
  whole = local;
  local = 200.9;
  byte = local;
  picked = local > 100 ? 32 : 0.5;
  counted = 1;
  counted++;
  before = counted++;
  ++counted;
  counted--;
  shifted *= 5.2;
  mixed += 2.9;
  called = function(2.5, 6);
  absolute = fabs(one - 2.5);
  chain = (sum - 0.5) + (sum + one / 2);
  while (1);
}
