/* A receiver for NEC remote controls on RB0: the key shows on port A if the address is ours. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#include <stdint.h>
#define _XTAL_FREQ 4000000

#define ADDRESS 0x1B

static uint8_t width(uint8_t level)
{
    uint8_t count = 0;
    while (PORTBbits.RB0 == level) {
        __delay_us(40);
        if (++count == 250)
            break;
    }
    return count;
}

static uint8_t frame(uint8_t *bytes)
{
    uint8_t n, bit;

    if (width(0) < 150)
        return 0;
    if (width(1) < 75)
        return 0;
    for (n = 0; n < 4; n++) {
        for (bit = 0; bit < 8; bit++) {
            width(0);
            bytes[n] >>= 1;
            if (width(1) > 20)
                bytes[n] |= 0x80;
        }
    }
    return (uint8_t)(bytes[0] ^ bytes[1]) == 0xFF && (uint8_t)(bytes[2] ^ bytes[3]) == 0xFF;
}

void main(void)
{
    uint8_t bytes[4];

    TRISA = 0;
    TRISB = 0xFF;
    PORTA = 0;
    while (1) {
        while (PORTBbits.RB0)
            ;
        if (frame(bytes) && bytes[0] == ADDRESS)
            PORTA = bytes[2] & 0x0F;
    }
}
