// expect: seen == 8
// expect: prescaler == 5
// expect: copied == 2
// expect: cleared == 0
#include <pic16f84a.h>
#include <xc.h>
bit f @ ((unsigned)&PORTB*8+3);
unsigned char seen, prescaler, copied, cleared;
void main(void)
{
  PORTBbits_t copy;
  TRISB = 0;
  PORTB = 0;
  f = 1;
  seen = PORTB;
  OPTION_REG = 0;
  OPTION_REGbits.PS = 5;
  prescaler = OPTION_REG;
  *(unsigned char *)&copy = 0;
  copy.RB1 = 1;
  copied = *(unsigned char *)&copy;
  PORTBbits.RB3 = 0;
  cleared = f;
}
