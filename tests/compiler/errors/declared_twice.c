char a;
// error: 'a' is already declared
// hint: at declared_twice.c:1:6
int a;
// warning: the parameter 'x' is never used
void f(char x) { }
// error: 'f' was declared as 'void(unsigned char)' before, now as 'void(int)'
// hint: the other declaration is at declared_twice.c:6:6
void f(int x);
// error: the function 'f' is defined twice
// hint: first at declared_twice.c:6:6
void f(char x) { }
void main(void) {
  char b;
  // error: 'b' is already declared
  char b;
}
