void one(void) {
  // error: syntax error: ';' is missing after '1'
  PORTB = 1
  PORTA = 2;
}
void two(void) {
  // error: syntax error before ')' (invalid expression)
  PORTB = (1 + );
}
void main(void) {
  // error: 'x' is not declared
  x = 1;
}
