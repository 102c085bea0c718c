// struct, union, bit-fields, arrays of structures, assignment, parameters and results by value, sizeof.
// expect: a == 0x1234
// expect: low == 0x34
// expect: f == 5
// expect: flags == 0x1B
// expect: size == 7
// expect: px == 9
// expect: py == -3
// expect: copied == 77
// expect: negative == -2
typedef struct { unsigned char x; int y; } point;
union pair { unsigned int word; struct { unsigned char low, high; }; unsigned char bytes[2]; };
struct status { unsigned ready : 1; unsigned mode : 3; unsigned last : 1; };
struct odd { unsigned char c; long l; int i; };
struct small { signed int v : 3; };
unsigned int a;
unsigned char low, f, flags, size, px, copied;
int py, negative;
union pair p;
union { struct status bits; unsigned char byte; } s;
point grid[3];
point make(unsigned char x, int y) {
  point r;
  r.x = x;
  r.y = y;
  return r;
}
int sum(point q) { return q.x + q.y; }
void main(void) {
  point t;
  struct small tiny;
  p.word = 0x1234;
  a = p.word;
  low = p.low;
  if (p.bytes[1] != p.high) low = 0;
  s.bits.ready = 1;
  s.bits.mode = 5;
  s.bits.last = 1;
  f = s.bits.mode;
  flags = s.byte;
  size = sizeof(struct odd);
  t = make(9, -3);
  grid[2] = t;
  px = grid[2].x;
  py = grid[2].y;
  copied = sum(make(70, 7));
  tiny.v = -2;
  negative = tiny.v;
}
