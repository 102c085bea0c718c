// Constants and functions at words of the program memory, in SDCC's words.
#include <pic14/pic16f84a.h>

__code volatile unsigned char __at(0x300) list[] = {5, 6, 7};
static __code unsigned int __at 0x3F0 version = 0x0102;
void f(void) __at(0x200);
void other(void) __critical __interrupt(0) { T0IF = 0; }

// expect: from_list == 7
// expect: of_version == 0x0102
// expect: called == 1
unsigned char from_list, called, at = 2;
unsigned int of_version;

void main(void) {
  from_list = list[at];
  of_version = version;
  f();
  INTCON = 0xA0;
  GIE = 0;
}

void f(void) { called = 1; }
