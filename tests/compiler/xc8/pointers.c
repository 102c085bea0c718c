// Pointers to RAM, to const in flash, to structures; arrays; strings; pointer arithmetic.
// expect: sum == 60
// expect: len == 5
// expect: second == 120
// expect: diff == 2
// expect: word == 0x0201
// expect: total == 33
// expect: last == 0x5B
// expect: back == 30
// expect: before == 20
// expect: far_before == 10
// expect: word_before == 0x34
// expect: null == 0
// expect: either == 3
#include <xc.h>
struct point { unsigned char x; int y; };
const unsigned char segments[] = { 0x3F, 0x06, 0x5B };
const char *text = "Hello";
unsigned char data[3] = { 10, 20, 30 };
unsigned int sum, word, total;
unsigned char len, second, diff, last, back, before, far_before, word_before, null, either;
int words[3] = { 1, 0x1234, 3 };
struct point points[2];
unsigned char length(const char *s) {
  unsigned char n = 0;
  while (*s++) n++;
  return n;
}
unsigned int add(const unsigned char *p, unsigned char n) {
  unsigned int t = 0;
  while (n--) t += *p++;
  return t;
}
void fill(struct point *p, unsigned char v) {
  p->x = v;
  p->y = v + 1;
}
void main(void) {
  unsigned char *p = data, *q = &data[2];
  unsigned char pair[2] = { 1, 2 };
  unsigned char i;
  sum = add(data, 3);
  len = length(text);
  diff = q - p;
  word = pair[0] | pair[1] << 8;
  for (i = 0; i < 2; i++) fill(&points[i], 10 + i);
  total = points[0].y + points[1].y + points[0].x;
  last = segments[i];
  back = *q;
  before = *(&data[2] - 1);
  q = &data[2] - 2;
  far_before = *q;
  word_before = *(unsigned char *)(&words[2] - 1);
  // the address of an object is never null
  if (!&data[1]) null = 1;
  either = null || &pair[1] ? 3 : 4;
  second = 'x';
  if (*p != 10) second = 0;
}
