char counter;
void main(void) {
  // error: 'countr' is not declared
  // hint: did you mean 'counter'?
  countr = 1;
  // error: the function 'dleay_ms' is not declared
  // hint: did you mean 'delay_ms'?
  dleay_ms(5);
  // error: 'PORTC' is not declared
  PORTC = 0;
  // error: there is no label 'end' in 'main'
  goto end;
}
