// A structure initialises a member or element of its type as a whole (ISO C 6.7.9, paragraph 13).
// expect: both == 3107
// expect: mixed == 1246
// expect: named == 56
// expect: elements == 3
// expect: listed == 7034
// expect: bits == 0x2B
// expect: around == 0x102
#include <xc.h>
struct point { unsigned char x; int y; };
struct line { struct point a, b; unsigned char w; };
struct field { unsigned char f : 3, g : 5; };
struct holder { unsigned char before; struct field k; unsigned char after; };
struct point p = { 7, 100 }, list[2] = { { 1, 2 }, { 3, 4 } };
struct field two = { 3, 5 };
const struct point fixed = { 5, 6 };
int both, mixed, listed, around;
unsigned char named, elements, bits;
struct point made(unsigned char x, int y) { struct point r = { x, y }; return r; }
void main(void) {
  struct point *last = &list[1];
  {
    struct line l = { p, *last, 3 };
    both = l.w * 1000 + l.a.y + l.b.x + l.b.y;
  }
  {
    struct line l = { 1, 2, made(4, 6), 1 };
    mixed = l.w * 1000 + l.a.x * 200 + l.a.y * 20 + l.b.y;
  }
  {
    struct { unsigned char w; struct point b; } l = { .b = fixed };
    named = l.w + l.b.x * 10 + l.b.y;
  }
  {
    struct point all[] = { p, { 3, 0 }, made(4, 6) };
    elements = sizeof all / sizeof all[0];
    listed = all[0].x * 1000 + all[1].x * 10 + all[1].y + all[2].x;
  }
  {
    struct holder h = { 1, two, 2 };
    bits = *(unsigned char *)&h.k;
    around = h.before << 8 | h.after;
  }
}
