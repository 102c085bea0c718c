/* Eight bytes, by insertion. */
#include <pic16f84.h>

static unsigned char result;

static void add(unsigned char value)
{
    result = (unsigned char)(result << 1 | result >> 7) ^ value;
}

static unsigned char data[8] = {90, 12, 250, 3, 77, 77, 128, 1};

static void run(void)
{
    unsigned char i;

    for (i = 1; i < 8; i++) {
        unsigned char value = data[i], j = i;

        while (j && data[j - 1] > value) {
            data[j] = data[j - 1];
            j--;
        }
        data[j] = value;
    }
    for (i = 0; i < 8; i++)
        add(data[i]);
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
