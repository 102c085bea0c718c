// Bit-fields of more than 8 bits, variables in the EEPROM.
// expect: r1 == 600
// expect: r2 == 700
// expect: r3 == 21
// expect: r4 == 65529
// expect: r5 == 6
// expect: r10 == 65529
// expect: r11 == 65528
// expect: size == 5
// expect: r12 == 9
// expect: r13 == 0x1234
// expect: cut == 64569
// expect: below == 1
// expect: highest == 511
// expect: lowest == 64512
// expect: around == 0
// expect: byte == 255
#include <xc.h>
struct { unsigned a:4; unsigned b:10; unsigned c:2; int d:12; } s = { 5, 600, 2, -7 };
__eeprom unsigned char e = 5;
__eeprom int t[3] = { 1, -2, 3 };
__eeprom struct { unsigned char x; unsigned int y; } z = { 9, 0x1200 };
unsigned int r1, r2, r3, r10, r11, r13;
int r4;
unsigned char r5, size, r12, below;
struct { signed int m:11; } l;
int cut, j = 1081;
struct { unsigned u:15; } zero;
struct { unsigned u:9; signed s:11; } wrapping = { 511, -1024 };
__eeprom unsigned char full = 255;
unsigned int highest, around, byte;
int lowest;
void main(void) {
  struct { unsigned w:9; unsigned v:7; } local = { 300, 100 };
  cut = (l.m = j);
  below = zero.u - 2 < 0;
  r1 = s.b;
  s.b += 100;
  r2 = s.b;
  s.c = 1;
  r3 = s.c * 16 + s.a;
  r4 = s.d--;
  r11 = s.d;
  e = e + 1;
  r5 = e;
  t[1] -= 5;
  r10 = t[1];
  size = sizeof s - (local.w == 300 && local.v == 100 ? 0 : 1);
  r12 = z.x;
  z.y |= 0x34;
  r13 = z.y;
  highest = wrapping.u++;
  lowest = wrapping.s--;
  around = wrapping.u;
  byte = full++;
}
