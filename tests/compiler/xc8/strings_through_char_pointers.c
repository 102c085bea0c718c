// expect: sum == 294
// expect: shown == 97
// expect: chosen == 121
// expect: listed == 99
// expect: member == 100
// expect: copied == 120
// expect: renamed == 110
// expect: ram == 122
#include <xc.h>
#include <string.h>
// strings given to a `char *` that nothing is written through: it is a pointer to const
unsigned int sum;
char shown, chosen, listed, member, copied, renamed, ram;
char buffer[4];
char *menu[] = { "ab", "cd" };
struct item { char *name; char number; } items[] = { { "xx", 1 }, { "dd", 2 } };
char *title = "aa";
unsigned int total(char *text);
unsigned int total(char *text) {
  unsigned int found = 0;
  while (*text) found += *text++;
  return found;
}
char *pick(char which) {
  if (which) return "yes";
  return "no";
}
char first(char *text) { return text[0]; }
char through(char *text) { return first(text + 1); }
void copy(char *to, char *from) {  // `to` is written through and reaches RAM only
  while (*from) *to++ = *from++;
  *to = 0;
}
void main(void) {
  char *local = "q";
  sum = total("abc");
  shown = first(title);
  chosen = first(pick(1));
  listed = first(menu[1]);
  member = first(items[1].name);
  copy(buffer, "xy");
  copied = first(buffer);
  menu[0] = "new";
  renamed = *menu[0];
  local = buffer;
  local = local + 1;
  buffer[1] = 'z';
  ram = through(buffer) + (*local - 'z');
}
