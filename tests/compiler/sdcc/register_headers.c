// expect: value == 5
// expect: guard == 1
#include <pic14regs.h>
#include <pic16regs.h>
static __code unsigned int __at(_CONFIG) config = _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF;
unsigned char value, guard;
void main(void) {
  value = 0b00000101u;
#ifdef __PIC16F84A_H__
  guard = 1;
#endif
}
