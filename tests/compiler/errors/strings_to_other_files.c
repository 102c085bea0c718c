// dialect: xc8
// what is wrong is that no file defines it, not that it gets a string
// error: the function 'show' is declared but not defined
void show(char *text);
void main(void) {
  show("abc");
}
