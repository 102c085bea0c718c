// dialect: xc8
// What cannot lie where it is put.
#include <xc.h>
// error: 'main' cannot have this address: main lies anywhere, an interrupt function at 0x004
void main(void) @ 0x10 { GIE = 1; }
// error: 'isr' cannot have this address: main lies anywhere, an interrupt function at 0x004
void interrupt isr(void) @ 0x20 { T0IF = 0; }
