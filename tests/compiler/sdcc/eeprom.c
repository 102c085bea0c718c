// Constants at the addresses that the EEPROM has in a HEX file: read from there.
// expect: first == 1
// expect: third == 3
// expect: last == 9
#include <pic14/pic16f84.h>
__code const unsigned char __at(0x210C) TABLE[] = { 1, 2, 3 };
__code const unsigned char __at(0x213F) END = 9;
unsigned char first, third, last;
void main(void) {
  unsigned char n;
  EEADR = 12;
  RD = 1;
  first = EEDATA;
  n = 2;
  third = TABLE[n];
  last = END;
}
