// The headers that XC8's <xc.h> includes may be included by themselves.
#include <builtins.h>
#include <inttypes.h>
#include <language_support.h>
#include <pic16f84.h>
#include <stdio.h>
#include <xc8debug.h>
#pragma config FOSC = XT

// expect: length == 4
// expect: text == 0x352D3937
// expect: decided == 1
char text[5];
int8_t small = -5;
uint16_t wide = 79;
bool decided;
unsigned char length;

void main(void) {
  length = sprintf(text, "%" PRIu16 "%" PRId8, wide, small);
  __debug_break();
  decided = 1;
}
