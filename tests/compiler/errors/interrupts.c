// dialect: xc8
char n;
void __interrupt() one(void) { n++; }
// error: there is a second interrupt function
// hint: the first is 'one' at interrupts.c:3:20
void __interrupt() two(void) { n++; }
void main(void) { }
