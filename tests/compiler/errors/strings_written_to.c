// dialect: xc8
#include <xc.h>
#include <string.h>
char *kept;
void upper(char *text) { text[0] -= 32; }
void keep(char *text) { kept = text; }
void end(void) { *kept = 0; }
void main(void) {
  // error: argument 1 of 'upper' would drop const: 'const unsigned char *' may point to flash, 'unsigned char *' cannot
  // hint: declare the pointer as a pointer to const
  upper("abc");
  // error: argument 1 of 'keep' would drop const: 'const unsigned char *' may point to flash, 'unsigned char *' cannot
  keep("abc");
  end();
  // error: argument 1 of 'strcpy' would drop const: 'const unsigned char *' may point to flash, 'unsigned char *' cannot
  strcpy("abc", "d");
}
