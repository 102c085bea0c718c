// Goes to 90 degrees and waits there for ever.
#include <xc.h>
#pragma config WDTE = OFF, FOSC = XT
#define _XTAL_FREQ 4000000
#define PULSES(n, us) for (i = 0; i < (n); i++) { RB0 = 1; __delay_us(us); RB0 = 0; __delay_ms(18); }
unsigned char i;
void main(void) {
  TRISB = 0;
  PORTB = 0;
  PULSES(100, 1160) __delay_ms(2000);
  while (1) { PULSES(250, 1495) }
}
