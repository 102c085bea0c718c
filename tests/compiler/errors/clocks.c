#pragma CLOCK_FREQ 4000000
// error: _CLOCK_FREQ says 8000000 Hz, #pragma CLOCK_FREQ says 4000000 Hz
// hint: one program has one clock: make them agree
#define _CLOCK_FREQ 8000000
void main(void) { }
