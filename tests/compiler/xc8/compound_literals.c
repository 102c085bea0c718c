// Unnamed structures and arrays in expressions; __func__.
// expect: y == 4
// expect: third == 3
// expect: sum == 30
// expect: first == 109
#include <xc.h>
struct P { unsigned char x, y; } p;
unsigned char y, third, sum, first;
unsigned char total(struct P *of) { return of->x + of->y; }
void main(void) {
  unsigned char i = 2;
  const char *name = __func__;
  p = (struct P){ 3, 4 };
  y = p.y;
  third = ((unsigned char[]){ 1, 2, 3 })[i];
  sum = total(&(struct P){ i + 8, 20 });
  first = name[0];
}
