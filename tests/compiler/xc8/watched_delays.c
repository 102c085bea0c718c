// Delays that clear the watchdog take exactly as long as those that do not.
#include <xc.h>
#define _XTAL_FREQ 4000000
void main(void) {
  TRISB = 0;
  PORTB = 1;
  _delaywdt(10);
// cycles: 12
  PORTB = 2;
  __delaywdt_us(6999);
// cycles: 7001
  PORTB = 3;
  __delaywdt_ms(20);
// cycles: 20002
  PORTB = 4;
  _delaywdt(123457);
// cycles: 123459
  PORTB = 5;
}
