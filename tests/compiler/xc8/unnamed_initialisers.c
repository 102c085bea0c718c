// Start values of unnamed structures inside others (ISO C 6.7.9): a part for itself, in braces or not, or by name;
// of a union the first member, or the one that is named.
// expect: braced == 0x0201
// expect: bare == 0x0403
// expect: fields == 0x39
// expect: named == 0x94
// expect: mixed == 0x070605
// expect: local == 0x090800
typedef struct { union { unsigned char a; unsigned char b; }; unsigned char c; } pair;
typedef union { struct { unsigned a : 1; unsigned b : 2; unsigned c : 3; }; unsigned char byte; } flags;
struct { unsigned char before; struct { unsigned char low, high; }; } three = { .high = 7, .low = 6, .before = 5 };
pair one = { { 1 }, 2 }, two = { 3, 4 };
flags three_fields = { { 1, 4, 7 } }, whole = { .byte = 0x94 };
unsigned int braced, bare;
unsigned char fields, named;
unsigned short long mixed, local;
void main(void) {
  unsigned char value = 9;
  struct { unsigned char before; struct { unsigned char low, high; }; } here = { .high = value, .low = 8 };
  braced = one.b | one.c << 8;
  bare = two.b | two.c << 8;
  fields = three_fields.byte;
  named = whole.byte;
  mixed = three.before | three.low << 8 | (unsigned short long)three.high << 16;
  local = here.before | here.low << 8 | (unsigned short long)here.high << 16;
}
