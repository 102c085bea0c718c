int sum(char a, char b);
void nothing(void) { }
void main(void) {
  char x;
  // error: 'sum' takes 2 arguments, 1 is given
  sum(1);
  // error: this has no value: its type is void
  x = nothing();
  // error: 'nothing' is a function; function pointers are not supported
  // hint: to call it, write nothing()
  x = nothing;
}
