// float of 32 bits, IEEE 754 binary32, where int has 16 bits and no sign: 65535 becomes 65535.0, not -1.0.
// expect: tenth == 0x3DCCCCCD
// expect: third == 0x3EAAAAAB
// expect: from_int == 0x477FFF00
// expect: from_signed == 0xC0400000
// expect: area == 0x42F6C000
// expect: whole == 123
// expect: shown == 1
// expect: root == 0x3FB504F3
// expect: folded == 0x3FB504F3
#include <math.h>
float tenth = 0.1, third, from_int, from_signed, area, root, folded;
int all = 65535, whole;
signed int few = -3;
char shown;
void main(void) {
  third = 1.0f / (few + 6);
  from_int = all;
  from_signed = few;
  area = 11.109375 * 11.109375 + (tenth - tenth);
  area = area - fabs(area - 123.375);
  whole = area;
  root = sqrt(third * 6);  // 2: a third is rounded up, and so is its product
  folded = sqrtf(2);
  shown = area == 123.375;
  while (1);
}
