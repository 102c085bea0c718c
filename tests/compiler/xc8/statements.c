// if, while, do, for, switch with fall-through, break, continue, goto, declarations in for and in blocks.
// expect: a == 45
// expect: b == 5
// expect: c == 25
// expect: d == 13
// expect: e == 3
// expect: f == 7
// expect: g == 2
// expect: h == 11
// expect: w == 1002
unsigned int a, w;
unsigned char b, c, d, e, f, g, h;
void classify(unsigned char n) {
  switch (n) {
    case 0:
      d += 1;
    case 1:
      d += 2;
      break;
    case 7:
    case 8: {
      unsigned char extra = 5;
      d += extra;
      break;
    }
    default:
      d += 100;
  }
}
unsigned int wide(unsigned int n) {
  switch (n) {
    case 1000: return 1;
    case 0x0102: return 2;
    case 300: return 1002;
  }
  return 0;
}
void main(void) {
  for (unsigned char i = 0; i < 10; i++) a += i;
  do b++; while (b < 5);
  for (;;) {
    if (++c > 30) break;
    if (c < 25) continue;
    break;
  }
  classify(0);
  classify(1);
  classify(7);
  d += 3;
  while (1) {
    e++;
    if (e == 3) goto done;
  }
done:
  f = 0;
  { unsigned char f2 = 7; f = f2; }
  for (unsigned char i = 0, j = 10; i < j; i++, j--) h = i + j + 1;
  g = h == 11 ? 2 : 3;
  w = wide(300);
}
