// A delay takes its cycles whatever stands around it; a port write by constants takes two.
#pragma CLOCK_FREQ 4000000
main() {
  char n;
  TRISB = 0;
  n = 24;
  PORTB = 1;
  delay_us(100);
  // cycles: 101
  PORTB = 0;
  delay_ms(2);
  // cycles: 2002
  PORTB = 1;
  delay_us(0);
  // cycles: 1
  PORTB = 0;
  delay_10us(255);
  // cycles: 2552
  PORTB = 1;
  delay_us(n);
  // cycles: 25
  PORTB = 0;
  delay_us(n);
  // cycles: 26
  PORTB = 1;
  delay_ms(n);
  // cycles: 24001
  PORTB = 0;
  if (n) delay_us(10);
  // cycles: 15
  PORTB = 1;
}
