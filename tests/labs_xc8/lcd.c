/* A HD44780 display on RB4 to RB7, RS on RA0, E on RA1: a text from flash, and a signed temperature. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

#include <stdint.h>

#define RS RA0
#define E RA1

static void nibble(uint8_t high)
{
    PORTB = (PORTB & 0x0F) | (high & 0xF0);
    E = 1;
    __delay_us(1);
    E = 0;
    __delay_us(40);
}

static void send(uint8_t byte, uint8_t is_letter)
{
    RS = is_letter;
    nibble(byte);
    nibble(byte << 4);
    if (!is_letter)
        __delay_ms(2);
}

static void print(const char *text)
{
    while (*text)
        send(*text++, 1);
}

static void at(uint8_t line, uint8_t column)
{
    send(0x80 | (line ? 0x40 : 0) | column, 0);
}

static void temperature(int16_t tenths)
{
    uint16_t rest = tenths;

    if (tenths < 0) {
        send('-', 1);
        rest = -tenths;
    }
    if (rest >= 100)
        send('0' + rest / 100, 1);
    send('0' + rest / 10 % 10, 1);
    send('.', 1);
    send('0' + rest % 10, 1);
    send(0xDF, 1);
    send('C', 1);
}

void main(void)
{
    PORTA = 0;
    PORTB = 0;
    TRISA = 0;
    TRISB = 0;
    __delay_ms(20);
    RS = 0;
    nibble(0x30);
    __delay_ms(5);
    nibble(0x30);
    __delay_us(150);
    nibble(0x30);
    nibble(0x20);
    send(0x28, 0);
    send(0x0C, 0);
    send(0x01, 0);
    send(0x06, 0);
    print("outside");
    at(1, 2);
    temperature(-127);
    at(0, 10);
    temperature(5);
    while (1);
}
