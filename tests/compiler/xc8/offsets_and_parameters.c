// offsetof and the address of a member are constants and read nothing; a parameter may be a function.
// expect: sizes == 0x0703
// expect: cases == 2
// expect: outer == 12
// expect: applied == 42
// expect: reach == 97
#include <xc.h>
#include <stddef.h>
struct s { unsigned char a; int b; unsigned long c; unsigned char d[3]; };
struct wide { unsigned char a[7], b[90], c; };
unsigned char array[offsetof(struct s, c)];
enum { END = offsetof(struct s, d[3]) };
const unsigned char starts[] = { offsetof(struct s, b), (unsigned char)&((struct s *)0)->d };
int sizes;
unsigned char cases, outer, applied, reach;
struct s whole;
static unsigned char twice(unsigned char v) { return 2 * v; }
static unsigned char apply(unsigned char f(unsigned char), unsigned char v) { return f(v); }
void main(void) {
  unsigned char *inner = &whole.d[1];
  sizes = starts[1] << 8 | sizeof array;
  switch (starts[0] * 7) {
    case offsetof(struct s, d): cases = 2;
  }
  whole.b = END + 2;
  outer = ((struct s *)(inner - offsetof(struct s, d[1])))->b;
  applied = apply(twice, 21);
  reach = offsetof(struct wide, b) + sizeof ((struct wide *)0)->b;
}
