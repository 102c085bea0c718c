// Integer promotion, usual conversions and every operator, on constants that the compiler cannot fold.
// expect: a == 300
// expect: b == 0xFFFB
// expect: c == 1
// expect: d == 0x12345678
// expect: e == -2
// expect: f == 3
// expect: g == 1
// expect: h == 65531
// expect: i == 100
// expect: j == 6
// expect: k == -2
// expect: l == 0x2468ACF0
// expect: m == 7
// expect: n == 24
#include <stdint.h>
unsigned char u8 = 200, v8 = 100;
signed char s8 = -5;
int16_t s16 = -5, a, b, c, e, k;
uint16_t h;
uint32_t u32 = 0x12345678, d, l;
unsigned char f, g, i, j, m, n;
void main(void) {
  a = u8 + v8;
  b = s8;
  c = s8 < 0;
  d = u32;
  e = s16 / 2;
  f = u8 % 7 + (v8 > u8);
  f -= 1;
  g = (u8 + v8 > 255) && !(v8 & 1);
  h = s16;
  i = u8 >> 1;
  j = f, j = f * 2, j += 0;
  j = f == 3 ? 6 : 9;
  k = s8 % 3;
  l = u32 << 1;
  m = 0;
  while (m < 7) m++;
  n = 1 << 3 | 1 << 4;
}
