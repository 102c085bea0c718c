/* A state machine that reads a word of symbols. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static volatile unsigned char symbols = 0x9C;

static void run(void)
{
    unsigned char state = 0, left = symbols, n;

    for (n = 0; n < 8; n++) {
        unsigned char one = left & 1;

        switch (state) {
        case 0:
            state = one ? 1 : 0;
            break;
        case 1:
            state = one ? 2 : 3;
            break;
        case 2:
            state = one ? 2 : 4;
            break;
        case 3:
            state = one ? 1 : 0;
            break;
        default:
            state = one ? 3 : 0;
            add(n);
            break;
        }
        left >>= 1;
    }
    add(state);
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
