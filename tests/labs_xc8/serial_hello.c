/* Software serial at 2400 baud, bit by bit: prints a table of squares on RA2. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

#include <stdint.h>

#define TX PORTAbits.RA2
#define BIT_CYCLES 417

static void put(char c)
{
    TX = 0;
    _delay(BIT_CYCLES - 5);
    for (uint8_t n = 8; n; n--) {
        if (c & 1)
            TX = 1;
        else
            TX = 0;
        c >>= 1;
        _delay(BIT_CYCLES - 12);
    }
    TX = 1;
    _delay(2 * BIT_CYCLES);
}

static void print(const char *text)
{
    while (*text)
        put(*text++);
}

static void number(uint16_t value)
{
    char digits[5];
    uint8_t count = 0;

    do {
        digits[count++] = '0' + value % 10;
        value /= 10;
    } while (value);
    while (count)
        put(digits[--count]);
}

void main(void)
{
    PORTA = 4;
    TRISA = 0x1B;
    __delay_ms(2);
    print("Hello\r\n");
    for (uint16_t n = 98; n <= 102; n++) {
        number(n);
        print("^2=");
        number(n * n);
        print(n < 102 ? ", " : "\r\n");
    }
    SLEEP();
    while (1);
}
