// Pointers to functions: variables, parameters, constant tables, comparison; a null pointer calls nothing.
// expect: one == 4
// expect: two == 17
// expect: three == 15
// expect: calls == 3
// expect: equal == 3
// expect: wide == 70000
// expect: upper == 65
// expect: cast == 6
// expect: nothing == 0
#include <xc.h>
#include <ctype.h>
typedef unsigned char (*op)(unsigned char, unsigned char);
unsigned char add(unsigned char a, unsigned char b) { return a + b; }
unsigned char sub(unsigned char a, unsigned char b) { return a - b; }
unsigned char both(op f) { return f(9, 4) + (*f)(1, 1); }
const op ops[] = { add, sub };
unsigned char one, two, three, calls, equal, upper, nothing = 5;
int cast;
unsigned int next(unsigned int n) { return n + 1; }
typedef int (*step)(int);
const step steps[] = { (step)next };
unsigned long wide;
void count(void) { calls++; }
void three_times(void (*what)(void)) { unsigned char i; for (i = 3; i; i--) what(); }
unsigned long seventy(void) { return 70000; }
void main(void) {
  op f = sub, none = 0;
  unsigned long (*g)(void) = &seventy;
  unsigned char (*h)(unsigned char) = toupper;
  one = f(7, 3);
  two = ops[1](20, 3);
  three = both(add);
  three_times(count);
  if (none) equal = 100; else equal = 1;
  if (f == sub) equal += 2;
  if (f == add) equal += 8;
  none(1, 2);
  wide = g();
  upper = h('a');
  cast = steps[0](5);
  nothing = none(1, 2);
}
