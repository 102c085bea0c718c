// dialect: xc8
enum state { OFF, ON, BLINK } state;
unsigned char a, b, list[4];
int s;
unsigned int u;
struct point { unsigned char x, y, z; };
// warning: the member 'z' has no value and starts with 0
struct point p = { 1, 2 };
// warning: this element already has a value
unsigned char twice[2] = { [0] = 1, [0] = 2 };
// warning: a comment begins inside a comment
// hint: the first '*/' ends both
/* first /* second */
// warning: 'unused_variable' is never used
static unsigned char unused_variable;
// warning: 'unused_function' is never called
static void unused_function(void) { a = 1; }
unsigned char pressed(void) { return a++; }
unsigned char total(unsigned char values[4],
  // warning: the parameter 'length' is never used
  // hint: '(void)length;' marks it as intentional
  unsigned char length) {
  // warning: 'values' is a pointer here: this is not the size of the array
  // hint: pass the length as another parameter
  return sizeof values + values[0];
}
void conditions(void) {
  // warning: '&&' only tests whether this constant is 0
  // hint: '&' combines the bits
  if (a && 0x01) b = 1;
  // warning: '||' only tests whether this constant is 0
  // hint: '|' combines the bits
  if (a || 4) b = 1;
  // warning: '!' of a constant is 0 or 1
  // hint: '~' inverts each bit
  a &= !0x04;
  // warning: '^' is exclusive or, not a power
  // hint: 1 << n is a power of two
  u = 2 ^ 8;
  // warning: 'a' is compared with itself
  if (a == a) b = 2;
  // warning: these two comparisons together are always true
  // hint: '&&' may be meant
  if (a != 1 || a != 2) b = 3;
  // warning: these two comparisons together are always false
  // hint: '||' may be meant
  if (a < 3 && 7 < a) b = 4;
  // warning: this address is always true
  // hint: call the function: write its name and parentheses
  if (pressed) b = 5;
  // warning: this address is always true
  // hint: an element needs an index
  if (list) b = 6;
  // warning: this compares a signed and an unsigned number: a negative one counts as large and positive
  // hint: declare both in the same way, or cast one
  if (s < u) b = 7;
  // warning: '&&' is evaluated before '||'
  if (a || b && s) b = 8;
  // warning: '&' is evaluated before '|'
  a = a | b & 1;
}
void statements(void) {
  unsigned char i, j = 0, *q = list;
  // warning: the body of this 'if' is this ';'
  // hint: what follows runs in either case
  if (a) ;
  // warning: the body of this 'else' is this ';'
  if (a) b = 1; else ;
  if (a)
    b = 1;
    // warning: this is indented like the statement above it, but does not depend on the condition
    // hint: put braces around both
    b = 2;
  // warning: 'a' is assigned to itself
  a = a;
  // warning: the value that the pointer points to is read but not used
  // hint: '(*p)++' changes it, 'p++' moves the pointer
  *q++;
  *q = 1;
  // warning: the loop never changes 'i', which its condition tests
  for (i = 0; i < 4; j++) b = j;
  // warning: there is no case for ON, BLINK
  // hint: add the case, or a default
  switch (state) { case OFF: b = 1; }
  switch (a) {
    // warning: this is never reached: it stands before the first case
    b = 2;
    case 1: b = 3;
  }
// warning: nothing jumps to 'never'
never:
  b++;
}
void paths(void) {
  unsigned char c;
  if (a) c = 1;
  // warning: 'c' is set only if a condition holds, but is read in any case
  b = c;
}
void main(void) {
  b = total(list, p.x + twice[0]);
  conditions();
  statements();
  paths();
}
