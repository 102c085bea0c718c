// A call before the function is written, main without a type, a function without return, many arguments.
// expect: a == 15
// expect: b == 21
int a, b;
main()
{
  a = sum(1, 2, 3, 4, 5);
  b = twice(sum(1, 1, 1, 1, 6)) + 1;
  nothing();
}
int sum(char p, char q, int r, char s, char t)
{
  return p + q + r + s + t;
}
int twice(int n)
{
  return n + n;
}
// warning: 'nothing' can reach its end without returning a value
int nothing()
{
  // warning: 'a' is assigned to itself
  a = a;
}
