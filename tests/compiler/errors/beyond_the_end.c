// dialect: xc8
// error: the program's 12 words do not fit around what lies at fixed addresses
#include <xc.h>
void last(void) @ 0x3FF {
  PORTA = 1;
  PORTB = 1;
}
void main(void) {
  TRISB = TRISA = 0;
  last();
}
