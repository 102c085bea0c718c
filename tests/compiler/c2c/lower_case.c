// BoostC's spellings: lower-case registers, bits by number.
// expect: x == 3
#include <system.h>
#pragma CLOCK_FREQ 4000000
unsigned char x;
void main()
{
  trisb = 0x00;
  portb = 0;
  portb.1 = 1;
  x = portb;
  x.0 = 1;
  // warning: GIE is set, but there is no interrupt function
  set_bit(intcon, GIE);
  clear_bit(intcon, GIE);
  status.C = 0;
}
