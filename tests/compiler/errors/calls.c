int sum(char a, char b);
void nothing(void) { }
void main(void) {
  char x;
  // error: 'sum' takes 2 arguments, 1 is given
  sum(1);
  // error: this has no value: its type is void
  x = nothing();
  // warning: the assignment makes 'unsigned char' from the pointer 'void (*)()' without a cast
  // hint: to call a function, write its name and parentheses
  x = nothing;
}
