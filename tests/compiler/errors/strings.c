char text[8];

void main(void) {
  // warning: the escape '\xDFC' is more than 8 bits and becomes 0xFC
  // hint: a string that ends behind an escape ends it too: "\xDF" "C"
  const char *unit = "25\xDFC";
  // warning: the escape '\777' is more than 8 bits and becomes 0xFF
  text[0] = '\777';
  text[1] = unit[2];
}

#define SPELLED(x) #x
// error: the '#' of a macro makes no string of 'a\'
char bad[] = SPELLED(a\);
