// XC8's macros multiply by cycles a microsecond and cut the rest off; floating constants are exact.
// dialect: xc8
#include <xc.h>
#define _XTAL_FREQ 3579545
#define PULSE 2.5
void main(void) {
  TRISB = 0;
  PORTB = 1;
  // warning: 10 µs is not a whole number of cycles at 3579545 Hz: 8 cycles are 8.939683675 µs
  __delay_us(10);
  // cycles: 9
  PORTB = 0;
  // warning: 2.5 µs is not a whole number of cycles at 3579545 Hz: 2 cycles are 2.234920919 µs
  __delay_us(PULSE);
  // cycles: 4
  PORTB = 1;
  // warning: 500 µs is not a whole number of cycles at 3579545 Hz: 447 cycles are 499.5048253 µs
  __delay_ms(0.5);
  // cycles: 448
  PORTB = 0;
  // warning: 750 µs is not a whole number of cycles at 3579545 Hz: 671 cycles are 749.8159682 µs
  __delay_ms(-(-1.5) / 2);
  // cycles: 673
  PORTB = 1;
}
