// Words that other compilers take for qualifiers are names where a name stands.
// expect: wide == 8
// expect: less == 6
// expect: sum == 12
// expect: product == 21
// expect: shifted == 32
unsigned char wide, less, sum, product, far = 7;
unsigned char bit = 3, bool, shifted;
struct { unsigned char near, rom; } s;
unsigned char twice(unsigned char eeprom) { return eeprom * 2; }
void main(void) {
  unsigned char near;
  near = far + 1;
  wide = near;
  less = far - 1;
  s.near = s.rom = 3;
  s.near += twice(s.rom);
  sum = s.near + s.rom;
  product = s.rom * far;
  bool = bit + 2;
  shifted = 1 << bool;
}
