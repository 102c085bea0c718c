// expect: copied == 111
// expect: of_member == 100
// expect: of_pointer == 99
// expect: of_list == 98
// expect: of_rows == 103
// expect: put_in == 104
// expect: returned == 99
// expect: unnamed == 99
// expect: called == 121
// expect: counted == 5
// expect: found == 118
#include <xc.h>
// a character `text[i]` is a copy: what is done with it does not write through `text`
char buffer[6], out[10];
struct item { char *name; char number; } items[] = { { "ab", 1 }, { "cd", 2 } };
char *list[2] = { "ab", "cd" };
char *rows[2][2] = { { "ab", "cd" }, { "ef", "gh" } };
char *filled[2][2];
char copied, of_member, of_pointer, of_list, of_rows, put_in, returned, unnamed, called, counted, found;
const char *constant[1] = { "uv" };  // the array itself is in RAM
void copy(char *to, char *from) {
  unsigned char i;
  for (i = 0; from[i]; i++) to[i] = from[i];
  to[i] = 0;
}
char second(char *text) { char *rest = &text[1]; return rest[1]; }
unsigned char length(char *text) {
  char *end = text;
  while (*end) end++;
  return end - text;
}
char third(char *);
char third(char *text) { return text[2]; }
// functions of one type are called through a pointer of that type
char next(const char *text) { return text[1]; }
char call(char (*function)(const char *), char *text) { return function(text); }
void main(void) {
  unsigned char i = 1;
  struct item *item = &items[1];
  copy(buffer, "hello");
  copied = buffer[4];
  out[0] = items[i].name[1];
  out[1] = item->name[0];
  out[2] = list[0][i];
  out[3] = rows[1][1][0];
  filled[i][0] = "hi";
  out[4] = filled[1][0][0];
  out[5] = second("abc");
  out[6] = third("abc");
  list[0] = rows[1][0];
  out[7] = list[0][1];
  out[8] = call(next, "xyz");
  out[9] = length("hello");
  of_member = out[0];
  of_pointer = out[1];
  of_list = out[2];
  of_rows = out[3];
  put_in = out[4];
  returned = out[5];
  unnamed = out[6];
  called = out[8];
  counted = out[9];
  void *any = constant;
  const char **again = any;
  found = again[0][1];
}
