struct point { char x; };
struct point p;
char c, *q;
void main(void) {
  // error: 'struct point' has no member 'y'
  p.y = 1;
  // error: an integer is needed here, not 'struct point'
  c = p + 1;
  // error: '*' needs a pointer, not 'unsigned char'
  c = *c;
  // error: this cannot be assigned to
  1 = c;
  // error: 'unsigned char' has no members
  c.x = 1;
  // error: division by zero
  c = c / 0;
  // error: the assignment needs 'struct point', not 'unsigned char'
  p = c;
  // error: 'unsigned char' cannot be indexed
  c[1] = 2;
}
