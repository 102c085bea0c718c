// dialect: xc8
#include <xc.h>
struct pair { unsigned char low, high; };
struct nothing {
  char a;
  // error: this member has no name
  int;
};
unsigned char v;
void main(void) {
  // error: the address 0xCA00 does not fit 'volatile unsigned char *'
  // hint: it has 1 byte
  *(volatile unsigned char *)0xCA00 = 5;
  // error: there is no memory at 0xF0 for 1 byte
  // hint: RAM is 0x0C to 0x4F
  v = *(unsigned char *)0xF0;
  // error: there is no memory at 0x50 for 1 byte
  // hint: RAM is 0x0C to 0x4F
  ((struct pair *)0x4F)->high = 1;
  // error: there is no memory at 0x50 for 1 byte
  // hint: RAM is 0x0C to 0x4F
  ((unsigned char *)0x40)[16] = 1;
  *(volatile unsigned char *)0x06 = 1;
  *(volatile unsigned char *)0x86 = 1;
  *(unsigned int *)0xCE = 1;
  ((unsigned char *)0x40)[15] = 1;
  if ((unsigned char *)v == (unsigned char *)0xFFFF || (unsigned char *)v == (unsigned char *)-1) v = 0;
}
