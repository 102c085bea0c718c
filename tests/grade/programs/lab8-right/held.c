// The servo holds its position: pulses go on while it waits.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF
#define _XTAL_FREQ 4000000
void main(void) {
  unsigned char n;
  TRISBbits.TRISB0 = 0;
  PORTB = 0;
  while (1) {
    for (n = 0; n < 100; n++) {
      RB0 = 1; __delay_us(1166); RB0 = 0; __delay_us(18820);
    }
    for (n = 0; n < 250; n++) {
      RB0 = 1; __delay_us(1500); RB0 = 0; __delay_us(18490);
    }
    for (n = 0; n < 150; n++) {
      RB0 = 1; __delay_us(1666); RB0 = 0; __delay_us(18320);
    }
  }
}
