// adjacent strings are joined after their escapes are read (ISO C 5.1.1.2)
#include <stdio.h>
#include <xc.h>
#define NAME(x) #x

const char unit[] = "25\xDF" "C";
const char octal[] = "\1" "2" "" "\0" "1";
const char *text = "\x1" "2";
char b[4];

// expect: size == 5
// expect: degree == 0xDF
// expect: letter == 67
// expect: octal_size == 5
// expect: two == 50
// expect: behind_pointer == 50
// expect: in_format == 3
// expect: quotes == 5
unsigned char size, degree, letter, octal_size, two, behind_pointer, in_format, quotes;

void main(void) {
  size = sizeof unit;
  degree = unit[2];
  letter = unit[3];
  octal_size = sizeof octal;
  two = octal[1];
  behind_pointer = text[1];
  in_format = sprintf(b, "\x4" "1" NAME(5));
  quotes = sizeof "\x4" "\"a" "'";
}
