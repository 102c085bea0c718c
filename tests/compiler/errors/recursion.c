char n;
void b(void);
void a(void) { b(); }
// error: recursion is not possible on this chip: a → b → a
// hint: the variables of a function have fixed addresses; use a loop
void b(void) { a(); }
void main(void) { a(); }
