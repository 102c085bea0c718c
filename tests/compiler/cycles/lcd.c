/* Letters for a display, two nibbles each, through port B. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static const char text[] = "Servo 12";

static void nibble(unsigned char high)
{
    PORTB = (PORTB & 0x0F) | (high & 0xF0);
    RB1 = 1;
    RB1 = 0;
    add(PORTB);
}

static void run(void)
{
    unsigned char n;

    for (n = 0; text[n]; n++) {
        nibble(text[n]);
        nibble(text[n] << 4);
    }
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
