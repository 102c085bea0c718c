/* The median and the mean of nine measurements, sent as decimal numbers over a software serial line. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#include <stdint.h>
#define _XTAL_FREQ 4000000

static uint8_t samples[9];

static void put(char c)
{
    PORTAbits.RA0 = 0;
    _delay(100);
    for (uint8_t n = 8; n; n--) {
        PORTAbits.RA0 = c & 1;
        c >>= 1;
        _delay(90);
    }
    PORTAbits.RA0 = 1;
    _delay(104);
}

static void number(uint16_t value)
{
    uint16_t power = 10000;
    uint8_t shown = 0;
    while (power) {
        uint8_t digit = value / power;
        value %= power;
        if (digit || shown || power == 1) {
            put('0' + digit);
            shown = 1;
        }
        power /= 10;
    }
    put('\n');
}

static void sort(uint8_t *data, uint8_t count)
{
    for (uint8_t i = 1; i < count; i++) {
        uint8_t value = data[i], j = i;
        while (j && data[j - 1] > value) {
            data[j] = data[j - 1];
            j--;
        }
        data[j] = value;
    }
}

void main(void)
{
    PORTA = 1;
    TRISA = 0x1E;
    TRISB = 0xFF;
    while (1) {
        uint16_t sum = 0;
        for (uint8_t n = 0; n < 9; n++) {
            samples[n] = PORTB;
            sum += samples[n];
            __delay_ms(5);
        }
        sort(samples, 9);
        number(samples[4]);
        number(sum / 9);
    }
}
