// From position to position on a ramp of widths, a step of 10 us each pulse.
#include <xc.h>
#define _XTAL_FREQ 4000000
unsigned char width;  // in tens of microseconds above 1 ms
static void pulse(void) {
  unsigned char n;
  RB0 = 1;
  __delay_us(993);
  for (n = 0; n < width; n++) { _delay(2); NOP(); }
  RB0 = 0;
  __delay_ms(18);
}
static void hold(unsigned char frames) { while (frames--) pulse(); }
static void go(unsigned char to) {
  while (width != to) {
    if (width < to) width++; else width--;
    pulse();
  }
}
void main(void) {
  TRISB = 0;
  PORTB = 0;
  width = 17;
  while (1) {
    hold(104);
    go(50);
    hold(252);
    go(67);
    hold(150);
    go(17);
  }
}
