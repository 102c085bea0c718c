// Times are constants: floating constants of __delay_us and __delay_ms are exact.
// dialect: xc8
// clock: 4000000
unsigned char n;
float f;
void main(void) {
  __delay_us(1.5e1 + 5);
  // error: the time must be a whole number
  _delay(2.5);
  // error: '__delay_us' cannot take a negative time
  __delay_us(-1.5);
  // error: '__delay_us' needs a constant argument
  __delay_us(1.5 * n);
  // error: '__delay_us' needs a constant argument
  __delay_us(f);
  // error: the time must be a whole number
  __delay_us(1.0 / 0);
  // error: 1e999 does not fit 'float'
  __delay_us(1e999);
  // warning: 0.5 does not fit 'unsigned char' and becomes 0
  n = 0.5;
  // warning: 65537 has more digits than 'float' and becomes 65536
  f = 65537;
}
