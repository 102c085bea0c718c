// pump.c: the start button RB0 runs the pump on RB6 for 2 s; the stop button RB1 ends it, and a fault on RA4 locks it.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

enum { IDLE, RUNNING, FAULT };

void main(void)
{
    unsigned char state = IDLE, tenths = 0, n;

    OPTION_REGbits.nRBPU = 0;
    PORTB = 0;
    TRISB = 0x03;
    while (1) {
        switch (state) {
        case IDLE:
            RB6 = 0;
            if (!RB0 && RB1) {
                tenths = 0;
                state = RUNNING;
            }
            break;
        case RUNNING:
            RB6 = 1;
            if (!RB1 || ++tenths == 20)
                state = IDLE;
            break;
        case FAULT:
            RB6 = 0;
            RB7 = 1;
            break;
        }
        if (!RA4)
            state = FAULT;
        for (n = 0; n < 10; n++)
            __delay_ms(10);
    }
}
