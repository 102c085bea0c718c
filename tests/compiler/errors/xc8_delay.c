// dialect: xc8
#include <xc.h>
#define _XTAL_FREQ 4000000
unsigned char n;
void main(void) {
  // error: '__delay_ms' needs a constant argument
  // hint: call it in a loop that counts the variable
  __delay_ms(n);
  // error: '_delay' takes 0 to 50463240 cycles, not 50463241
  _delay(50463241);
  // error: '__delay_ms' takes at most 50463240 cycles, not 60000000
  // hint: call it several times, or in a loop
  __delay_ms(60000);
  // error: 'set_bit' belongs to the C2C dialect
  set_bit(n, 1);
}
