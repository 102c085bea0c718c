/* A button on RB0 with the pull-up of the chip; debounced by eight equal samples. Each press shows on RB7. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

#include <stdbool.h>
#include <stdint.h>

#define BUTTON PORTBbits.RB0
#define LED PORTBbits.RB7

static uint8_t samples = 0xFF;

static bool falling(void)
{
    static bool down = false;

    samples = (uint8_t)(samples << 1) | BUTTON;
    if (samples == 0x00 && !down) {
        down = true;
        return true;
    }
    if (samples == 0xFF)
        down = false;
    return false;
}

void main(void)
{
    TRISB = 0x01;
    OPTION_REGbits.nRBPU = 0;
    LED = 0;
    while (true) {
        if (falling())
            LED ^= 1;
        __delay_ms(2);
    }
}
