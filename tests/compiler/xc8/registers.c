// Registers of both banks, fixed addresses, the EEPROM, inline assembly with C variables.
// expect: a == 0x0F
// expect: b == 7
// expect: c == 0x42
// expect: d == 8
// expect: e == 0x55
// expect: f == 1
#include <xc.h>
unsigned char a, b, c, d, e, f;
unsigned char fixed __at(0x30);
unsigned char other @ 0x31;
void main(void) {
  TRISB = 0x0F;
  OPTION_REG = 7;
  a = TRISB;
  TRISBbits.TRISB0 = 0;
  b = OPTION_REG & 7;
  fixed = 0x42;
  c = *(unsigned char *)0x30;
  eeprom_write(5, 8);
  d = eeprom_read(5);
  asm("movlw 0x55");
  asm("movwf _e");
  other = 1;
  f = sizeof(PORTBbits);
}
