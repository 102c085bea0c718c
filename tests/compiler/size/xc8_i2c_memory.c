/* Bytes of a 24C02 on RA0 (data) and RA1 (clock) are copied to port B, one after the other. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#include <stdint.h>
#define _XTAL_FREQ 4000000

#define SDA_DIR TRISAbits.TRISA0
#define SDA PORTAbits.RA0
#define SCL PORTAbits.RA1

static void start(void)
{
    SDA_DIR = 1;
    SCL = 1;
    __delay_us(5);
    SDA = 0;
    SDA_DIR = 0;
    __delay_us(5);
    SCL = 0;
}

static void stop(void)
{
    SDA = 0;
    SDA_DIR = 0;
    SCL = 1;
    __delay_us(5);
    SDA_DIR = 1;
    __delay_us(5);
}

static uint8_t send(uint8_t byte)
{
    uint8_t refused;
    for (uint8_t n = 8; n; n--) {
        SDA = 0;
        SDA_DIR = (byte & 0x80) != 0;
        SCL = 1;
        __delay_us(5);
        SCL = 0;
        byte <<= 1;
    }
    SDA_DIR = 1;
    SCL = 1;
    refused = SDA;
    SCL = 0;
    return refused;
}

static uint8_t receive(uint8_t last)
{
    uint8_t byte = 0;
    SDA_DIR = 1;
    for (uint8_t n = 8; n; n--) {
        SCL = 1;
        byte = (uint8_t)(byte << 1) | SDA;
        SCL = 0;
    }
    SDA = 0;
    SDA_DIR = last;
    SCL = 1;
    __delay_us(5);
    SCL = 0;
    SDA_DIR = 1;
    return byte;
}

static uint8_t memory(uint8_t address)
{
    uint8_t byte;
    start();
    while (send(0xA0)) {
        stop();
        start();
    }
    send(address);
    start();
    send(0xA1);
    byte = receive(1);
    stop();
    return byte;
}

void main(void)
{
    uint8_t address = 0;
    TRISA = 0x01;
    TRISB = 0;
    while (1) {
        PORTB = memory(address++);
        __delay_ms(100);
    }
}
