// Says hello at 9600 baud on RB1, then sends back each letter it hears on RB0 as a capital.
#pragma CLOCK_FREQ 4000000
#pragma RS232_TXPORT PORTB
#pragma RS232_TXPIN 1
#pragma RS232_RXPORT PORTB
#pragma RS232_RXPIN 0
#pragma RS232_BAUD 9600
#pragma TRUE_RS232 1

const char hello[8] = {'H', 'e', 'l', 'l', 'o', '\r', '\n', 0};

void main(void)
{
    char i, c;

    PORTB = 2;                         // the line is idle, before it is an output
    set_bit(STATUS, RP0);
    TRISB = 11111101b;
    clear_bit(STATUS, RP0);
    delay_ms(5);

    i = 0;
    while (hello[i]) {
        putchar(hello[i]);
        i++;
    }
    while (1) {
        c = getchar();
        if (c >= 'a' && c <= 'z')
            c = c - 32;
        putchar(c);
    }
}
