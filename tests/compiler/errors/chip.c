// dialect: xc8
#include <xc.h>
// warning: 'ticks' has 2 bytes and is shared with the interrupt, which can occur between two of them
// hint: disable interrupts around its uses in the main program
unsigned int ticks;
unsigned int safe;
unsigned char seconds;
void __interrupt() tick(void) {
  ticks++;
  safe++;
  seconds++;
}
void main(void) {
  unsigned int copy;
  TRISB = 0xF0;
  ei();
  if (ticks > 100) seconds = 0;
  di();
  copy = safe;
  ei();
  if (copy) RB1 = 1;
  // warning: RB5 is an input: TRISB never makes it an output
  RB5 = 1;
  // warning: RA0 is an input: TRISA never makes it an output
  PORTA |= 1;
}
