// SDCC's extensions: addresses without parentheses, __sfr, __sbit, __data, __naked, __critical, interrupt numbers.
// expect: a == 5
// expect: b == 6
// expect: led == 4
// expect: plain == 8
// expect: from_asm == 77
// expect: guarded == 12
// expect: on == 1
// expect: off == 0
// expect: still_on == 1
#include <pic14/pic16f84a.h>
typedef unsigned int word;
word __at 0x2007 CONFIG = 0x3FF1;
__at 0x20 unsigned char v;
unsigned char __at 0x21 w;
__data unsigned char a, b, led, from_asm, guarded, on, off, still_on, plain;
__sfr __at (0x06) PB;
__sbit __at (0x32) led_bit;
__sfr __at 0x06 same_port;
__sbit __at 0x33 third_bit;
void isr(void) __interrupt 0 __using(1) { T0IF = 0; }
void set(void) __naked { __asm
  movlw 77
  movwf _from_asm
  return
__endasm; }
unsigned char guard(unsigned char n) __critical {
  off = GIE;
  if (n > 5) return n * 2;
  return n;
}
void main(void) {
  v = 5; w = 6; a = v; b = w;
  TRISB = 0;
  PB = 0;
  led_bit = 1;
  led = PORTB;
  same_port = 0;
  third_bit = 1;
  plain = PORTB;
  set();
  GIE = 1;
  __critical { guarded = 1; }
  on = GIE;
  guarded = guard(6);
  still_on = GIE;
}
