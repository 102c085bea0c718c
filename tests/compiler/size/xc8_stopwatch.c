/* Minutes, seconds and tenths on a display of four digits; the tick comes from timer 0. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#include <stdint.h>
#define _XTAL_FREQ 4000000

static const uint8_t digits[10] = {0x3F, 0x06, 0x5B, 0x4F, 0x66, 0x6D, 0x7D, 0x07, 0x7F, 0x6F};
static volatile uint8_t time[4];
static const uint8_t ends[4] = {10, 10, 6, 10};
static volatile uint8_t running, place;
static uint8_t ticks;

void __interrupt() tick(void)
{
    T0IF = 0;
    TMR0 += 6;
    PORTA = 0;
    PORTB = digits[time[place]];
    PORTA = (uint8_t)(1 << place);
    if (++place == 4)
        place = 0;
    if (running && ++ticks == 100) {
        ticks = 0;
        for (uint8_t n = 0; n < 4; n++) {
            if (++time[n] < ends[n])
                break;
            time[n] = 0;
        }
    }
}

void main(void)
{
    uint8_t was = 1;
    TRISA = 0x10;
    TRISB = 0;
    OPTION_REG = 0xD1;
    T0IE = 1;
    GIE = 1;
    while (1) {
        uint8_t now = PORTAbits.RA4;
        if (was && !now)
            running = !running;
        was = now;
        __delay_ms(10);
    }
}
