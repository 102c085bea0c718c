// `#x` doubles the backslashes of literals only (ISO C 6.10.3.2); a ';' behind #include is a slip that XC8 forgives
#include <xc.h>
// warning: the ';' behind #include is ignored
#include <string.h>;
#define SPELLED(x) #x
#define EXPANDED(x) SPELLED(x)
#define NEW_LINE \n

const char plain[] = SPELLED(a\n), literals[] = SPELLED("x\n" '\\'), macro[] = EXPANDED( NEW_LINE   b ),
           quote[] = SPELLED("\""), comment[] = SPELLED(a /* c */ b);

// expect: plain_size == 3
// expect: new_line == 10
// expect: literals_size == 11
// expect: backslash == 92
// expect: macro_size == 4
// expect: quote_size == 5
// expect: comment_size == 4
unsigned char plain_size, literals_size, macro_size, quote_size, comment_size, new_line, backslash;

void main(void) {
  plain_size = sizeof plain;
  new_line = plain[1];
  literals_size = sizeof literals;
  backslash = literals[2];
  macro_size = sizeof macro;
  quote_size = sizeof quote;
  comment_size = sizeof comment;
}
