// The timer's interrupt counts while main computes with the same functions; nothing is disturbed.
// expect: good == 1
#include <xc.h>
volatile unsigned char count;
unsigned char good;
unsigned int scaled(unsigned int n) { return n * 7 / 3; }
void __interrupt() tick(void) {
  if (T0IF) {
    T0IF = 0;
    count += scaled(3) == 7;
  }
}
void main(void) {
  OPTION_REG = 0x08;
  T0IE = 1;
  ei();
  good = 1;
  while (count < 100) {
    if (scaled(300) != 700) good = 0;
  }
  di();
}
