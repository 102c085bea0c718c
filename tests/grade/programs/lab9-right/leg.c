// As the lab's program, with all four positions and widths that the servos take.
#pragma CLOCK_FREQ 4000000
void pas(char vertical, char orizontal, char cicle) {
  while (cicle) {
    PORTB = 0x01;
    delay_ms(1);
    delay_us(250);
    if (vertical) { delay_us(245); }
    PORTB = 0x02;
    delay_ms(1);
    delay_us(250);
    if (orizontal) { delay_us(245); }
    PORTB = 0x00;
    delay_ms(17);
    cicle--;
  }
}
main(void) {
  set_bit(STATUS, RP0);
  TRISB = 0x00;
  clear_bit(STATUS, RP0);
  while (1) {
    pas(1, 0, 20);  // jos, spate
    pas(0, 0, 20);  // sus, spate
    pas(0, 1, 20);  // sus, fata
    pas(1, 1, 20);  // jos, fata
  }
}
