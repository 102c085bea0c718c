// dialect: xc8
char a;
// error: 'c' is not a parameter of 'add'
char add(a, b) char a, b; char c; { return a + b; }
void main(void) { a = add(1, 2); }
