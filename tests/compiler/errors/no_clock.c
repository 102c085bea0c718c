void main(void) {
  // error: the clock frequency is not known
  // hint: write '#pragma CLOCK_FREQ 4000000' or '#define _XTAL_FREQ 4000000', or give --clock-hz
  delay_ms(1);
}
