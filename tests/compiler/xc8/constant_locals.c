// A constant array or structure of a block is in flash where its values are known, otherwise in RAM.
// expect: table == 7
// expect: sums == 722
// expect: made == 72
// expect: copied == 56
// expect: looped == 78
// expect: large == 9
#include <xc.h>
struct f { int x; unsigned char y; };
struct f g = { 5, 6 };
unsigned char table, copied, large;
int sums, made, looped;
static struct f make(int x) { struct f f = { x, 2 }; return f; }
static int sum(const struct f *f) { return f->x * 10 + f->y; }
void main(void) {
  unsigned char a = 3, b = 4, i;
  const unsigned char known[3] = { 1, 2, 4 }, given[3] = { a, b, a + b };
  const struct f result = make(7), *p = &result;
  const unsigned char many[100] = { [50] = 9 };
  table = known[0] + known[i = 1] + known[2];
  sums = given[2] * 100 + given[i + 1] * (a + b == 7) + given[0] + given[1] * 2 + given[i];
  made = sum(p);
  {
    const struct f copy = g;
    copied = sum(&copy);
  }
  for (i = 0; i < 3; i++) {
    const struct f each = { i * a, 1 };
    const int pair[2] = { each.x, -i };
    looped += sum(&each) + pair[1] - 12 * (i == 2);
  }
  large = many[i + 47];
}
