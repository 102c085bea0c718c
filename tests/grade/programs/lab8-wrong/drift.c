// The low time grows with every pulse: the period drifts from 19 to 20.3 ms.
#include <xc.h>
#pragma config WDTE = OFF, FOSC = XT
#define _XTAL_FREQ 4000000
unsigned char i, k;
#define PULSES(n, us) for (i = 0; i < (n); i++) { RB0 = 1; __delay_us(us); RB0 = 0; __delay_ms(17); for (k = 0; k < i; k++) _delay(6); }
void main(void) {
  TRISB = 0;
  PORTB = 0;
  while (1) {
    PULSES(100, 1160) __delay_ms(2000);
    PULSES(100, 1495) __delay_ms(5000);
    PULSES(100, 1660) __delay_ms(3000);
  }
}
