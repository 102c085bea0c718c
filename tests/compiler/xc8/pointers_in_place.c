// Pointers at fixed addresses and in the EEPROM: the address and the EEPROM are the pointer's own.
// expect: at20 == 2
// expect: at24 == 1
// expect: through == 7
// expect: called == 9
// expect: read == 7
// expect: moved == 1
// expect: back == 1
#include <xc.h>
unsigned char x, y[2], at20, at24, through, called, read, moved, back;
unsigned char *p @ 0x20;
unsigned char (*pa)[2] __at(0x21);
__at(0x22) unsigned char (*pf)(void), after;
unsigned char *px[3] @ 0x23;
unsigned char *__eeprom ep;
unsigned char *__eeprom eps[2];
unsigned char nine(void) { return 9; }
void main(void) {
  p = (unsigned char *)2;
  px[1] = (unsigned char *)1;
  at20 = *(unsigned char *)0x20;
  at24 = *(unsigned char *)0x24;
  p = &x;
  *p = 3;
  pa = &y;
  (*pa)[1] = 4;
  through = x + y[1];
  pf = nine;
  called = pf();
  eps[1] = y;
  ep = eps[1];
  ep += 1;
  y[0] = 3;
  read = *ep + ep[-1];
  moved = ep++ == &y[1];
  ep--;
  back = ep - y;
}
