void main(void) {
  // error: the clock frequency is not known
  // hint: say '#pragma CLOCK_FREQ 4000000', '#define _XTAL_FREQ 4000000' or --clock-hz
  delay_ms(1);
}
