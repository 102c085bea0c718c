// dialect: xc8
const unsigned char table[] = { 1, 2 };
const int limit = 5;
char *p;
void main(void) {
  // error: 'limit' is const and cannot be changed
  limit = 6;
  // error: 'table' is const and cannot be changed
  table[1] = 2;
  // error: the assignment would drop const: 'const unsigned char *' may point to flash, 'unsigned char *' cannot
  // hint: declare the pointer as a pointer to const
  p = table;
}
