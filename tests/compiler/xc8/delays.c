// __delay_us, __delay_ms and _delay; at 8 MHz a microsecond is two cycles.
#include <xc.h>
#define _XTAL_FREQ 8000000
void main(void) {
  TRISB = 0;
  PORTB = 1;
  __delay_us(10);
  // cycles: 21
  PORTB = 0;
  __delay_ms(1);
  // cycles: 2002
  PORTB = 1;
  _delay(1);
  // cycles: 2
  PORTB = 0;
  _delay(100000);
  // cycles: 100002
  PORTB = 1;
  NOP();
  // cycles: 2
  PORTB = 0;
}
