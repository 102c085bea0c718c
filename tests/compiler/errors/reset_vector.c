// dialect: xc8
#include <xc.h>
// error: 'list' at 0x000 overlaps the reset vector, which ends at 0x000
const unsigned char list[] __at(0) = {1, 2, 3};
void main(void) { TRISB = list[0]; }
