// dialect: xc8
unsigned char buffer[4], one[1];
// error: an array needs at least one element, not 0
char none[0];
void main(void) {
  // warning: index 4 is outside the array of 4 elements
  buffer[4] = 1;
  one[0] = 1;
  // warning: index 1 is outside the array of 1 element
  one[1] = 1;
}
