// expect: sum == 1005
// expect: order == 12
// expect: quiet == 3
// parameters as C had them before 1989, and words that advise the original compilers
int add(a, b) int a; char b; { return a + b; }
unsigned char join(high, low)
unsigned char high, low;
{
  return 10 * high + low;
}
unsigned char __attribute__((noinline)) three(void) { return 3; }
int sum;
unsigned char order, quiet;
void main(void) {
  sum = add(1000, 5);
  order = join(1, 2);
  quiet = three();
}
