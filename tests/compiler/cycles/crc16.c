/* CRC-16 (CCITT) of four bytes. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char data[4] = {'1', '2', '3', '4'};

static void run(void)
{
    unsigned int crc = 0xFFFF;
    unsigned char n, bit;

    for (n = 0; n < 4; n++) {
        crc ^= (unsigned int)data[n] << 8;
        for (bit = 0; bit < 8; bit++) {
            if (crc & 0x8000)
                crc = (crc << 1) ^ 0x1021;
            else
                crc <<= 1;
        }
    }
    add(crc & 0xFF);
    add(crc >> 8);
}

void main(void)
{
    TRISA = 0;
    TRISB = 0;
    PORTA = 0;
    PORTB = 0;
    RA0 = 1;
    run();
    RA0 = 0;
    PORTB = result;
    RA1 = 1;
    while (1)
        ;
}
