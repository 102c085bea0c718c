// Makes RB0 an output, and its pulses on RB2, which stays an input.
#include <xc.h>
#pragma config WDTE = OFF, FOSC = XT
#define _XTAL_FREQ 4000000
#define PULSES(n, us) for (i = 0; i < (n); i++) { RB2 = 1; __delay_us(us); RB2 = 0; __delay_ms(18); }
unsigned char i;
void main(void) {
  TRISB = 0xFE;
  PORTB = 0;
  while (1) {
    PULSES(100, 1160) __delay_ms(2000);
    PULSES(100, 1495) __delay_ms(5000);
    PULSES(100, 1660) __delay_ms(3000);
  }
}
