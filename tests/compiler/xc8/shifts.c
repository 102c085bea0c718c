// Shifts by constants and variables, of signed and unsigned values of each width.
// expect: a == 0x0050
// expect: b == -3
// expect: c == 0x80
// expect: d == 0x00345000
// expect: e == 0x12
// expect: f == 0xFFFFFFFF
// expect: g == 0x2000
unsigned int a, g;
int b;
unsigned char c, e, n = 4;
unsigned long d, big = 0x12345;
long f;
unsigned char five = 5;
signed char minus = -20;
void main(void) {
  a = five << n;
  b = minus >> 3;
  c = five << 7;
  d = (big & 0x345) << (n + 8);
  e = big >> 12;
  f = (long)minus >> 24;
  g = 1 << (n + 9);
}
