// Assembly as XC8's and MPASM's users write it: BANKSEL, BANKMASK, names of registers with an underscore.
// expect: direction == 0x0F
// expect: level == 0x30
// expect: moved == 7
#include <xc.h>
unsigned char direction, level, moved;
void main(void) {
  asm("movlw 0x0F");
  asm("BANKSEL _TRISB");
  asm("movwf _TRISB & 0x7F");
  asm volatile("BANKSEL(_PORTB)\n movlw 0x30\n movwf BANKMASK(_PORTB)");
  asm("banksel _moved");
  asm("movlw 7");
  asm("movwf (_moved) & 0x7F");
  direction = TRISB;
  level = PORTB & 0xF0;
}
