// SDCC's assembly: blocks up to __endasm, strings of a macro, literals that the assembler computes, a C function
// that assembly calls with W as it left it.
// expect: sum == 55
// expect: third == 3
// expect: called == 42
// expect: computed == 251
// expect: kept == 7
#include <pic14/pic16f84.h>

#define load(value, name) __asm__("movlw ((" #value ") - 14) / 1000 + 1\n movwf _" #name)

unsigned char sum, third, called, computed, kept, count, got;

void take(void)
{
    __asm
    movwf   _got        // W is the caller's
    __endasm;
}

void main(void)
{
    __asm
    movlw   10          ; a comment of the assembler's
    movwf   _count
again:
    movf    _count, W   // one of C's
    addwf   _sum, F
    decfsz  _count, F
    goto    again
    __endasm;
    load(2500, third);
    load(250000, computed);
    computed++;
    __asm movlw 7
    movwf _kept __endasm;
    __asm__("movlw 21\n"
            " call _take");
    called = got * 2;
}
