// int and long have 16 bits and no sign; char has 8 and none; signed is there for those who say so.
// expect: a == 65535
// expect: b == 1
// expect: c == 400
// expect: d == 0
// expect: e == 1
int a, c;
char b, d, e, x, y;
signed char s;
main() {
  a = 0;
  a--;
  b = a > 5;
  x = 200;
  y = 200;
  c = x * y / 100;
  // warning: this comparison is always false
  if (x - y < 0) d = 1;
  s = -3;
  if (s < 0) e = 1;
}
