// Values of 24 bits in structures, unions, arrays, behind pointers and in the EEPROM. What computes a place is
// computed once.
// expect: member == 0x3F4000
// expect: moved == 1
// expect: index == 3
// expect: cells_0 == 0x3F8000
// expect: cells_1 == 0x40A000
// expect: from_pointer == 0x41C800
// expect: remembered == 0x404800
// expect: bits == 0x408000
// expect: field == 5
#include <xc.h>
unsigned char moved, index, field;
__eeprom float kept = 1.25;
float member, cells_0, cells_1, from_pointer, remembered;
struct { unsigned char n : 3; float f; } s;
float cells[2] = { 1, 2 };
unsigned short long bits;
void store(float *p, float x) { *p = x; }
void main(void) {
  float *p = cells;
  union { float f; unsigned short long bits; } u;
  s.f = cells[0] - 0.25;
  member = s.f;
  *p++ += 0;
  moved = p - cells;
  index = 1;
  cells[index++] *= 2.5;
  index++;
  cells_0 = cells[0];
  cells_1 = cells[1];
  store(&from_pointer, 25);
  kept += 1.875;
  remembered = kept;
  u.f = 4;
  bits = u.bits;
  s.n = 2;
  s.n *= 2.75;
  field = s.n;
  while (1);
}
