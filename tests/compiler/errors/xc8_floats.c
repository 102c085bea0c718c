// Floating constants are taken by __delay_us and __delay_ms alone.
// dialect: xc8
// clock: 4000000
unsigned char n;
void main(void) {
  __delay_us(1.5e1 + 5);
  // error: '2.5': this compiler has no floating point
  // hint: use scaled integers
  _delay(2.5);
  // error: '__delay_us' takes no negative time
  __delay_us(-1.5);
  // error: '1.5': this compiler has no floating point
  // hint: use scaled integers
  __delay_us(1.5 * n);
  // error: '1.0': this compiler has no floating point
  // hint: use scaled integers
  __delay_us(1.0 / 0);
  // error: '1e999': this compiler has no floating point
  __delay_us(1e999);
  // error: '0.5': this compiler has no floating point
  n = 0.5;
}
