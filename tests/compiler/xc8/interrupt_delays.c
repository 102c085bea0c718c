// Delays and tables of the interrupt have routines of their own: main's are not disturbed in their middle.
// expect: wrong == 0
// expect: rounds == 200
#include <xc.h>
#define _XTAL_FREQ 4000000
const unsigned char squares[] = { 0, 1, 4, 9, 16, 25, 36, 49 };
volatile unsigned char seen;
unsigned char wrong, rounds;
void pause(void) { __delay_us(40); __delay_us(40); __delay_us(37); }
void __interrupt() tick(void) {
  T0IF = 0;
  seen = squares[seen & 7];
  pause();
  __delay_us(40);
}
void main(void) {
  unsigned char i;
  OPTION_REG = 0;
  T0IE = 1;
  GIE = 1;
  while (rounds < 200) {
    for (i = 0; i < 8; i++)
      if (squares[i] != (unsigned char)(i * i)) wrong = 1;
    pause();
    rounds++;
  }
  GIE = 0;
}
