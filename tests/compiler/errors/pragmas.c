// error: #pragma CLOCK_FREQ needs a frequency in hertz, not 'fast'
#pragma CLOCK_FREQ fast
// warning: unknown #pragma NONSENSE
#pragma NONSENSE 1
// error: unknown configuration setting 'FOSZ'
// hint: did you mean 'FOSC'?
#pragma config FOSZ = XT
// error: 'QT' is not a value of FOSC
// hint: known: EXTRC, HS, LP, RC, XT
#pragma config FOSC = QT
void main(void) { }
