// Where an integer is needed, and constants that a conversion changes. float has 32 bits in this dialect.
#include <math.h>
#include <stdio.h>
float f = 1, g[3];
unsigned char n, table[4], *p;
unsigned int w;
struct {
  // error: a bit-field has 1 to 16 bits of an integer type
  float field : 3;
} s;
// error: 64-bit integers are not supported
// hint: the widest type is 32 bits
long long wide;
// error: 'unsigned float' is not a type
unsigned float u;
// error: an integer is needed here, not 'float'
char sized[f];
// error: an integer is needed here, not 'float'
char by_number[2.0];
// error: the initialiser must be a constant
float before = f++;
// error: the initialiser must be a constant
float sum = f + 1;
void main(void) {
  // error: an integer is needed here, not 'float'
  f = f % 2;
  // error: an integer is needed here, not 'float'
  f = f & 1;
  // error: an integer is needed here, not 'float'
  f = 1 | f;
  // error: an integer is needed here, not 'float'
  f = f << 1;
  // error: an integer is needed here, not 'float'
  n = n >> f;
  // error: an integer is needed here, not 'float'
  n = ~f;
  // error: '%=' cannot be applied to 'float'
  f %= 2;
  // error: '<<=' cannot be applied to 'float'
  f <<= 1;
  // error: an integer is needed here, not 'float'
  n ^= f;
  // error: an integer is needed here, not 'float'
  n = table[f];
  // error: an integer is needed here, not 'float'
  switch (f) { }
  // error: only an integer variable has bits
  f.3 = 1;
  // error: '+' cannot be applied to 'unsigned char *' and 'float'
  p = p + f;
  // error: 'unsigned char *' cannot be converted to 'float'
  f = (float)p;
  // error: the assignment needs 'float', not 'unsigned char *'
  f = p;
  // error: 'float' cannot be converted to 'unsigned char *'
  p = (unsigned char *)f;
  // error: the assignment needs 'unsigned char *', not 'float'
  p = f;
  // error: the assignment needs 'float', not 'float *'
  f = g;
  switch (n) {
    // error: an integer is needed here, not 'float'
    case 1.5: break;
  }
  // error: 1e39 does not fit 'float'
  f = 1e39;
  // error: 1e999999999999999 does not fit 'float'
  f = 1e999999999999999;
  // error: the number has more than 400 digits
  f = 0.00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000001;
  // error: the time must be a whole number
  delay_ms(2.5);
  // error: 'printf': %d cannot print 'float'
  // hint: convert it to an integer with a cast
  printf("%d", f);
  // error: the format of 'printf': '%f' is not supported; there are %d %i %u %x %X %o %c %s, flags - 0 + and space, a width up to 255, hh h l
  printf("%f", f);
  // error: the library has no 'sin'
  // hint: of <math.h> it has fabs, sqrt, floor and ceil
  f = sin(f);
}
void warned(void) {
  // warning: 1e-60 is too small for 'float' and becomes 0
  f = 1e-60;
  // warning: 1e-999999999999999 is too small for 'float' and becomes 0
  f = 1e-999999999999999;
  // warning: 2.5 does not fit 'unsigned char' and becomes 2
  n = 2.5;
  // warning: 300 does not fit 'unsigned char' and becomes 44
  n = 300.0;
  // warning: 16777217 has more digits than 'float' and becomes 16777216
  f = 16777217;
  // warning: this statement has no effect
  f;
  // warning: this statement has no effect
  f * 2;
  n = (unsigned char)2.5;
  n = 3.0;
  f = (float)16777217;
  f = 16777216;
}
