// On RB3, and it starts at 90 degrees: a round may begin anywhere.
#include <xc.h>
#define _XTAL_FREQ 4000000
static void pulses(unsigned char n, unsigned char which) {
  while (n--) {
    RB3 = 1;
    if (which == 0) __delay_us(1160);
    else if (which == 1) __delay_us(1495);
    else __delay_us(1660);
    RB3 = 0;
    __delay_ms(18);
  }
}
void main(void) {
  TRISB = 0;
  for (;;) {
    pulses(60, 1);
    __delay_ms(5000);
    pulses(60, 2);
    __delay_ms(3000);
    pulses(60, 0);
    __delay_ms(2000);
  }
}
