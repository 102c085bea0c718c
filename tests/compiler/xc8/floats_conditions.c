// Conditions and comparisons: both zeros are false and equal, what is not a number is unequal to everything.
// expect: truths == 0x2B
// expect: order == 0x3F
// expect: nan == 0x08
// expect: loops == 5
#include <xc.h>
unsigned char truths, order, nan, loops;
float one = 1, tenth = 0.1, zero = -0.0;
void main(void) {
  float x;
  if (zero) truths |= 0x40;
  if (!zero) truths |= 1;
  if (tenth) truths |= 2;
  while (zero) truths |= 4;
  truths |= (tenth && one) << 3;
  truths |= (zero || 0.0) << 4;
  truths |= (unsigned char)(_Bool)tenth << 5;
  order = (tenth < one) | (tenth <= one) << 1 | (one > tenth) << 2 | (one >= 1) << 3 | (one == 1.0) << 4
      | (one != tenth) << 5 | (one < tenth) << 6 | (zero != 0) << 7;
  x = zero / zero;
  nan = (x < one) | (x >= one) << 1 | (x == x) << 2 | (x != x) << 3 | (0 > zero) << 4;
  for (x = 0; x < 0.45; x += tenth) loops++;
  while (1);
}
