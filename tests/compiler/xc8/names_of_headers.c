// Names that XC8's headers and library give: fields, types, EEPROM functions, bits at bit addresses.
// expect: prescaler == 5
// expect: option == 0x85
// expect: bits == 3
// expect: big == 70005
// expect: read == 7
// expect: flags == 0x22
// expect: port == 8
#include <htc.h>
#include <pic16f84a.h>
#define _XTAL_FREQ 4000000
unsigned char prescaler, option, bits, read, port;
unsigned char flags;
unsigned long big;
bit fifth @ ((unsigned)&flags*8+5);
static bit first @ (unsigned)&flags * 8 + 1;
bit third @ 0x06 * 8 + 3;
unsigned char text[] = { "Hello" };
__IDLOC(12AF);
void main(void) {
  PORTBbits_t copy;
  __uint24 n = 70000;
  __int24 m = -5;
  __CONFIG(0x3FF1);
  OPTION_REG = 0x80;
  OPTION_REGbits.PS = 5;
  prescaler = OPTION_REGbits.PS;
  option = OPTION_REG;
  copy.RB0 = copy.RB1 = 1;
  copy.RB2 = 0; copy.RB3 = 0; copy.RB4 = 0; copy.RB5 = 0; copy.RB6 = 0; copy.RB7 = 0;
  bits = *(unsigned char *)&copy;
  n -= m;
  big = n;
  EEPROM_WRITE(3, 7);
  read = EEPROM_READ(3);
  flags = 0;
  fifth = 1;
  first = 1;
  TRISB = 0;
  PORTB = 0;
  third = 1;
  port = PORTB;
}
