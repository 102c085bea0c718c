// Four rounds of 15.8 s, not endlessly.
#include <xc.h>
#pragma config WDTE = OFF, FOSC = XT
#define _XTAL_FREQ 4000000
#define PULSES(n, us) for (i = 0; i < (n); i++) { RB0 = 1; __delay_us(us); RB0 = 0; __delay_ms(18); }
unsigned char i, rounds;
void main(void) {
  TRISB = 0;
  PORTB = 0;
  for (rounds = 0; rounds < 4; rounds++) {
    PULSES(100, 1160) __delay_ms(2000);
    PULSES(100, 1495) __delay_ms(5000);
    PULSES(100, 1660) __delay_ms(3000);
  }
  while (1) ;
}
