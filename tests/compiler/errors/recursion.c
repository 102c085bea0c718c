char n;
void b(void);
void a(void) { b(); }
// error: recursion is not possible on this chip: a → b → a
// hint: variables of functions have fixed places; use a loop
void b(void) { a(); }
void main(void) { a(); }
