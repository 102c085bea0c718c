char n;
void interrupt(void) { n++; }
void main(void) {
  // error: the interrupt function 'interrupt' cannot be called
  interrupt();
}
