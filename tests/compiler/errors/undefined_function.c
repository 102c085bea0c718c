void later(void);
void main(void) {
  // error: the function 'later' is declared but not defined
  later();
}
