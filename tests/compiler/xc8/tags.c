// `struct tag;` alone begins a new type in its block, also where the block around it has one (ISO C 6.7.2.3).
// expect: inner == 9
// expect: size == 1
// expect: outer == 4
// expect: mixed == 5
#include <xc.h>
struct tag { unsigned char a, b; };
unsigned char inner, size, outer, mixed;
void main(void) {
  {
    struct tag;
    struct holder { struct tag *p; } holder;
    struct tag { unsigned char c; } x;
    holder.p = &x;
    holder.p->c = 9;
    inner = x.c;
    size = sizeof(struct tag);
  }
  {
    struct tag s = { 3, 4 };
    outer = s.b;
  }
  {
    union tag;
    union tag { unsigned char m; int n; } v;
    v.n = 0x105;
    mixed = v.m;
  }
}
