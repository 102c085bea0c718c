/* Frames of eight bytes from port B, strobed by RA4, are checked by CRC-16; RA0 is good, RA1 is bad. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#include <stdint.h>
#define _XTAL_FREQ 4000000

union word {
    uint16_t whole;
    struct { uint8_t low, high; } part;
};

static uint8_t frame[10];

static uint8_t strobed(void)
{
    while (!PORTAbits.RA4)
        ;
    uint8_t byte = PORTB;
    while (PORTAbits.RA4)
        ;
    return byte;
}

static uint16_t crc(const uint8_t *data, uint8_t count)
{
    uint16_t sum = 0xFFFF;
    while (count--) {
        sum ^= *data++;
        for (uint8_t n = 0; n < 8; n++)
            sum = sum & 1 ? (sum >> 1) ^ 0xA001 : sum >> 1;
    }
    return sum;
}

void main(void)
{
    union word sent;

    TRISA = 0x10;
    TRISB = 0xFF;
    PORTA = 0;
    while (1) {
        for (uint8_t n = 0; n < sizeof frame; n++)
            frame[n] = strobed();
        sent.part.low = frame[8];
        sent.part.high = frame[9];
        PORTA = sent.whole == crc(frame, 8) ? 1 : 2;
    }
}
