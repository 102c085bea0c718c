// commands.c: 1200 baud on RA1; 1 switches the lamp on RB7 on, 0 off, and each is answered by ! on RB5, all others by ?.
#include <xc.h>
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#define _XTAL_FREQ 4000000

#define BIT_US 833

unsigned char receive(void)
{
    unsigned char byte = 0, n;

    while (RA1) {}
    __delay_us(BIT_US / 2);
    for (n = 0; n < 8; n++) {
        __delay_us(BIT_US - 8);
        byte >>= 1;
        if (RA1)
            byte |= 0x80;
    }
    __delay_us(BIT_US);
    return byte;
}

void transmit(unsigned char byte)
{
    unsigned char n;

    RB5 = 0;
    for (n = 0; n < 8; n++) {
        __delay_us(BIT_US - 10);
        if (byte & 1)
            RB5 = 1;
        else
            RB5 = 0;
        byte >>= 1;
    }
    __delay_us(BIT_US - 10);
    RB5 = 1;
    __delay_us(BIT_US);
}

void main(void)
{
    PORTB = 0x20;
    TRISB = 0;
    while (1) {
        switch (receive()) {
        case '0':
            RB7 = 0;
            transmit('!');
            break;
        case '1':
            RB7 = 1;
            transmit('!');
            break;
        default:
            transmit('?');
        }
    }
}
