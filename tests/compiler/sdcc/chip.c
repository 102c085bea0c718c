// Names of SDCC's header, tables in flash, types of its sizes.
// expect: size == 4
// expect: word == 0x0302
// expect: bits == 5
// expect: negative == 0
// expect: ring == 0x3FF1
#include <stdint.h>
#include <pic14/pic16f84a.h>

static __code uint16_t __at(_CONFIG) configuration = _FOSC_XT & _WDTE_OFF & _PWRTE_ON & _CP_OFF;
static __code const unsigned char TABLE[] = { 1, 2, 3 };
__code unsigned char MORE[2] = { 0, 2 };

unsigned char size, bits, negative;
unsigned int word, ring;
volatile unsigned char one = 1;

void main(void)
{
    char plain = -1;

    TRISBbits.TRISB1 = 0;
    PORTBbits.RB1 = 1;
    RB1 = 0;
    T0IE = 1;
    INTCONbits.INTE = 1;
    OPTION_REGbits.NOT_RBPU = 0;
    STATUSbits.C = 0;
    size = sizeof(long);
    word = TABLE[one + 1] << 8 | MORE[one];
    bits = T0IE << 2 | INTE;
    // warning: this comparison is always false
    negative = plain < 0;
    ring = configuration;
}
