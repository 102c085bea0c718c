// Structures without a name that stand on one line are types of their own.
// expect: all == 0x2F
// expect: halves == 0x94
// expect: size == 2
union { struct { unsigned a : 1; unsigned b : 2; unsigned c : 3; }; unsigned char byte; } one;
typedef union { struct { unsigned : 2; unsigned c : 1; }; struct { unsigned low : 4; unsigned high : 4; }; unsigned char byte; } both;
unsigned char all, halves, size;
both two;
void main(void) {
  one.a = 1;
  one.b = 3;
  one.c = 5;
  all = one.byte;
  two.high = 9;
  two.c = 1;
  halves = two.byte;
  size = sizeof(one) + sizeof(two);
}
