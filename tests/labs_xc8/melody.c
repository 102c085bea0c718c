/* A tune on RB3: notes as half periods in tens of microseconds, played with timer 0 as the metronome. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

#include <stdint.h>

typedef struct {
    uint8_t half;                          /* half a period, in units of 10 us; 0 is a rest */
    uint8_t beats;
} note_t;

const note_t tune[] = {{114, 2}, {101, 1}, {90, 1}, {0, 1}, {57, 3}};

static void tone(uint8_t half, uint8_t beats)
{
    while (beats--) {
        uint8_t overflows = 2;
        T0IF = 0;
        TMR0 = 0;
        do {
            uint8_t n = half;
            if (n) {
                RB3 ^= 1;
                do {
                    __delay_us(7);
                } while (--n);
            }
            if (T0IF) {
                T0IF = 0;
                overflows--;
            }
        } while (overflows);
    }
}

void main(void)
{
    uint8_t n;

    PORTB = 0;
    TRISB = 0;
    OPTION_REG = 0xC7;                     /* 1:256: an overflow is 65.5 ms */
    for (n = 0; n < sizeof(tune) / sizeof(tune[0]); n++)
        tone(tune[n].half, tune[n].beats);
    RB3 = 0;
    while (1);
}
