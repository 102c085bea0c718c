// error: this compiler has no floating point
// hint: use scaled integers
float f;
void main(void) {
  // error: '1.5': this compiler has no floating point
  // hint: use scaled integers
  char a = 1.5;
  // error: 64-bit integers are not supported
  // hint: the widest type is 32 bits
  long long x;
}
