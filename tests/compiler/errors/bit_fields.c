// A bit-field that is too wide is one error; what it belongs to is known all the same.
struct wide {
  // error: a bit-field has 1 to 8 bits of an integer type
  char many : 12;
  char few : 3;
} s, other;
struct wide third;
// error: 64-bit integers are not supported
long long speed;
void main(void) {
  struct wide fourth;
  s.many = 5;
  other.few = s.few;
  third.few = 1;
  fourth.few = 2;
  speed = 3;
  // error: 'missing' is not declared
  missing = 1;
}
