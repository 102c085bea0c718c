// const tables in flash: one and two dimensions, words, structures, strings, pointers to strings; none uses RAM.
// expect: a == 0x0102
// expect: b == 6
// expect: c == 66
// expect: d == 300
// expect: e == 110
// expect: ram == 44
#include <stdint.h>
const unsigned int words[] = { 0x0001, 0x0102, 0x0203 };
const unsigned char grid[2][3] = { { 1, 2, 3 }, { 4, 5, 6 } };
const struct { char name; int value; } rows[2] = { { 'A', 100 }, { 'B', 300 } };
const char *const names[] = { "eins", "zwei", "drei" };
const int limit = 44;
unsigned int a, d;
unsigned char b, c, e, ram;
void main(void) {
  unsigned char i = 1;
  const char *s;
  a = words[i];
  b = grid[i][i + 1];
  c = rows[i].name;
  d = rows[i].value;
  s = names[i - 1];
  e = s[2];
  ram = limit;
}
