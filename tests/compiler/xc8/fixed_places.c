// Words such as __at belong to the name that their own declaration declares. Constants at an address are in the program
// memory, functions too: each reads or calls what the simulator finds there.
#include <xc.h>

#define TWO unsigned char first @ 0x30; unsigned char second @ 0x31

void __at(0x186) park(void);
unsigned char speed;
unsigned char f(void) @ 0x100 { return 1; }
const unsigned char list[] __at(0x0FE) = {10, 20};
const unsigned int version __at(0x3FE) = 0x1234;
const unsigned char *text = list;
TWO;
bank1 unsigned char frame[2];
static bank2 unsigned char *bank3 pointer;
unsigned char __bank(1) banked;
void (*__at(0x32) call)(void);

// expect: speed == 0x0F
// expect: called == 1
// expect: parked == 6
// expect: from_list == 20
// expect: by_index == 30
// expect: by_pointer == 10
// expect: of_version == 0x1234
// expect: first == 3
// expect: second == 4
// expect: other == 5
// expect: banked == 7
unsigned char called, parked, from_list, by_index, by_pointer, other, at = 1;
unsigned int of_version;

void main(void) {
  called = f();
  speed = 0x0F;
  park();
  from_list = list[1];
  by_index = list[at] + list[at - 1];
  by_pointer = text[0];
  of_version = version;
  first = 3;
  second = 4;
  frame[at] = 5;
  pointer = frame;
  other = pointer[at];
  banked = 7;
  call = park;
  call();
}

void park(void) { parked += 3; }
