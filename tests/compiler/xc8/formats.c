// the fields of characters, and the sizes hh and h (ISO C 7.21.6.1)
#include <stdio.h>
#include <xc.h>

char right[5], left[6], byte[3], negative_byte[3], hexadecimal[3], hex_short[5];
volatile int number = 300;
volatile char letter = 'k';

// expect: right == 0x216B2020
// expect: left == 0x5D20206B5B
// expect: byte == 0x3434
// expect: negative_byte == 0x332D
// expect: hexadecimal == 0x6466
// expect: hex_short == 0x64666666
// expect: lengths == 19
unsigned char lengths;

void main(void) {
  lengths = sprintf(right, "%3c!", letter);
  lengths += sprintf(left, "[%-3c]", letter);
  lengths += sprintf(byte, "%hhu", number);
  lengths += sprintf(negative_byte, "%hhd", 0x1FD);
  lengths += sprintf(hexadecimal, "%hhx", number - 303);
  lengths += sprintf(hex_short, "%hx", number - 303);
}
