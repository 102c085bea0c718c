// The lab's own way: 100 pulses, then a pause without pulses.
#pragma CLOCK_FREQ 4000000
void treizeci(int cicle) {
  while (cicle) {
    PORTB = 0x01;
    delay_ms(1);
    delay_us(167);
    PORTB = 0x00;
    delay_ms(18);
    cicle--;
  }
}
void nouazeci(int cicle) {
  while (cicle) {
    PORTB = 0x01;
    delay_ms(1);
    delay_us(250);
    delay_us(250);
    PORTB = 0x00;
    delay_ms(18);
    cicle--;
  }
}
void osutadouazeci(int cicle) {
  while (cicle) {
    PORTB = 0x01;
    delay_ms(1);
    delay_us(250);
    delay_us(250);
    delay_us(167);
    PORTB = 0x00;
    delay_ms(18);
    cicle--;
  }
}
main(void) {
  set_bit(STATUS, RP0);
  TRISB = 0x00;
  clear_bit(STATUS, RP0);
  while (1) {
    treizeci(100);
    delay_s(2);
    nouazeci(100);
    delay_s(5);
    osutadouazeci(100);
    delay_s(3);
  }
}
