#pragma CLOCK_FREQ 4000000
void main(void) {
  // error: 'delay_ms' takes 0 to 255, not 256
  delay_ms(256);
  // error: 'delay_us' takes 1 argument, 2 are given
  delay_us(1, 2);
  // error: '__delay_ms' belongs to the XC8 dialect
  __delay_ms(1);
}
