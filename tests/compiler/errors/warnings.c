// dialect: xc8
unsigned char a, i;
int b;
void main(void) {
  // warning: 300 does not fit 'unsigned char' and becomes 44
  a = 300;
  // warning: this comparison is always true
  // hint: the left side is 0 … 255, the right side 255 … 255
  for (i = 0; i <= 255; i++) b++;
  // warning: this is never reached
  // warning: an assignment is used as a condition
  // hint: '==' compares; write '((a = b))' if the assignment is meant
  if (a = 3) b = 1;
  // warning: this statement has no effect
  a + 1;
  // warning: this comparison has no effect
  // hint: '=' assigns, '==' compares
  a == 2;
  // warning: shift by 20, but 'int' has only 16 bits
  b = b << 20;
  return;
  // warning: this is never reached
  a = 1;
}
