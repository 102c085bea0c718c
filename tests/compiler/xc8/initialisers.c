// Initialisers of globals and locals: arrays, designators, structures, strings, static locals, cleared globals.
// expect: a == 6
// expect: b == 9
// expect: c == 99
// expect: d == 0
// expect: e == 3
// expect: f == 42
static unsigned char list[] = { 1, 2, 3 };
unsigned char sparse[5] = { [3] = 9 };
char word[] = "abc";
unsigned char zero[4];
struct { unsigned char p; int q; } pair = { .q = 42, .p = 1 };
unsigned char a, b, c, d, e;
int f;
unsigned char next(void) {
  static unsigned char n = 0;
  return ++n;
}
void main(void) {
  unsigned char i, local[3] = { 1, 2 };
  for (i = 0; i < 3; i++) a += list[i];
  b = sparse[3] + sparse[0] + local[2];
  c = word[2];
  d = zero[3];
  next();
  next();
  e = next();
  f = pair.q;
}
