// dialect: sdcc
#include <pic14/pic16f84.h>
__code const unsigned char __at(0x213E) fits[] = { 1, 2 };
// error: 'ends' ends at byte 65 of the EEPROM, which has 64
__code const unsigned char __at(0x213F) ends[] = { 1, 2 };
// error: 'behind' at 0x2140 is not in the program memory (0x000-0x3FF)
__code const unsigned char __at(0x2140) behind = 1;
// error: the address 0x2100 is not in the data memory (0x00-0xFF)
unsigned char __at(0x2100) changes;
void main(void) { changes = behind; }
