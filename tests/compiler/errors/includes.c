// error: include file 'nothing.h' was not found
#include "nothing.h"
// error: #error stop here
#error stop here
void main(void) { }
