// ISO C99 6.7.8: a later initialiser of an object overrides every earlier one of it, and of its parts.
// expect: kept == 98
// expect: cleared == 0
// expect: field == 4
// expect: beside == 9
// expect: other == 3
// expect: rest == 0
// expect: local == 0
// expect: binary == 2
struct row { unsigned char id; unsigned int pair[2]; };
// warning: this element already has a value
const struct row rows = { .pair = { 26, 0x1234 }, .pair = { 98 } };
struct bits { unsigned a : 4; unsigned b : 4; };
// warning: this element already has a value
const struct bits bits = { .a = 11, 9, .a = 4 };
const union { unsigned char pair[2]; unsigned char one; } either = { .pair = { 1, 2 }, .one = 3 };
unsigned char kept, cleared, field, beside, other, rest, local, binary;
void main(void) {
  // warning: this element already has a value
  struct row mine = { .pair = { 1, 7 }, .id = 5, .pair = { 2 } };
  kept = (unsigned char)rows.pair[0];
  cleared = (unsigned char)rows.pair[1];
  field = bits.a;
  beside = bits.b;
  other = either.one;
  rest = either.pair[1];
  local = (unsigned char)mine.pair[1];
  binary = sizeof 0b1000000000000000;
}
