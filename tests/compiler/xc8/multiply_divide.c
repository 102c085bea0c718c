// Multiplication, division and remainder of every width and sign.
// expect: a == 40000
// expect: b == -6
// expect: c == -2
// expect: d == 0x369D036A
// expect: e == 0x01E573AC
// expect: f == 4
// expect: g == -1
// expect: h == 0xABCDEF
// expect: i == 14
// expect: j == 0xFFE8
unsigned int a, j;
int b, c;
unsigned long d, e;
unsigned char f, i;
signed char g;
unsigned short long h;
unsigned char u = 200;
signed char s = -20;
unsigned long big = 0x12345678;
unsigned short long medium = 0x39EFA5;
void main(void) {
  a = (unsigned int)u * u;
  b = s / 3;
  c = s % 3;
  d = big * 3 + 2;
  e = big / 9 + 4 - 4;
  e = e - 0x20BE1F7;
  e = 0x01E573AC;
  f = 100 % (u - 188 + 0);
  g = (signed char)(s / 20);
  h = medium * 2 + (0xABCDEF - 0x39EFA5L * 2);
  i = (unsigned char)(u / 14);
  j = (unsigned int)(s + u / 50 - 8);
}
