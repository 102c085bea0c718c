// The first pulse never ends.
#include <xc.h>
#pragma config WDTE = OFF, FOSC = XT
#define _XTAL_FREQ 4000000
#define PULSES(n, us) for (i = 0; i < (n); i++) { RB0 = 1; __delay_us(us); RB0 = 0; __delay_ms(18); }
unsigned char i;
void main(void) {
  TRISB = 0;
  PORTB = 0;
  RB0 = 1;
  while (1) ;
}
