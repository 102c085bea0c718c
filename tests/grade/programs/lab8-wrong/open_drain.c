// On RA4, which can only pull to ground.
#include <xc.h>
#pragma config WDTE = OFF, FOSC = XT
#define _XTAL_FREQ 4000000
#define PULSES(n, us) for (i = 0; i < (n); i++) { RA4 = 1; __delay_us(us); RA4 = 0; __delay_ms(18); }
unsigned char i;
void main(void) {
  TRISA = 0;
  PORTA = 0;
  while (1) {
    PULSES(100, 1160) __delay_ms(2000);
    PULSES(100, 1495) __delay_ms(5000);
    PULSES(100, 1660) __delay_ms(3000);
  }
}
