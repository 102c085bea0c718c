/* A DS18B20 thermometer on RB0; the temperature in halves of a degree on port A and RB4 to RB7. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#include <stdint.h>
#define _XTAL_FREQ 4000000

static void low(void) { PORTBbits.RB0 = 0; TRISBbits.TRISB0 = 0; }
static void release(void) { TRISBbits.TRISB0 = 1; }

static uint8_t reset(void)
{
    uint8_t absent;
    low();
    __delay_us(480);
    release();
    __delay_us(70);
    absent = PORTBbits.RB0;
    __delay_us(410);
    return !absent;
}

static void write(uint8_t byte)
{
    for (uint8_t n = 0; n < 8; n++) {
        low();
        if (byte & 1) {
            __delay_us(5);
            release();
            __delay_us(60);
        } else {
            __delay_us(65);
            release();
        }
        byte >>= 1;
    }
}

static uint8_t read(void)
{
    uint8_t byte = 0;
    for (uint8_t n = 0; n < 8; n++) {
        byte >>= 1;
        low();
        __delay_us(2);
        release();
        __delay_us(8);
        if (PORTBbits.RB0)
            byte |= 0x80;
        __delay_us(55);
    }
    return byte;
}

static uint8_t crc(uint8_t sum, uint8_t byte)
{
    for (uint8_t n = 8; n; n--) {
        uint8_t mix = (sum ^ byte) & 1;
        sum >>= 1;
        if (mix)
            sum ^= 0x8C;
        byte >>= 1;
    }
    return sum;
}

void main(void)
{
    uint8_t pad[9];

    TRISA = 0;
    TRISB = 0x0F;
    while (1) {
        if (!reset())
            continue;
        write(0xCC);
        write(0x44);
        __delay_ms(750);
        reset();
        write(0xCC);
        write(0xBE);
        uint8_t sum = 0;
        for (uint8_t n = 0; n < 9; n++) {
            pad[n] = read();
            sum = crc(sum, pad[n]);
        }
        if (sum == 0) {
            int16_t halves = (int16_t)(pad[1] << 8 | pad[0]) >> 3;
            PORTA = halves & 0x0F;
            PORTB = halves & 0xF0;
        }
    }
}
