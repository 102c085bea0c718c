// dialect: xc8
// what is wrong is that no file defines it, not that it gets a string
void show(char *text);
void main(void) {
  // error: the function 'show' is declared but not defined
  show("abc");
}
