// A frequency counter: TMR0 counts RA4 for a second; the value goes out in decimal at 9600 baud.
#pragma CLOCK_FREQ 4000000

#pragma RS232_TXPORT PORTB
#pragma RS232_TXPIN 0
#pragma RS232_RXPORT PORTB
#pragma RS232_RXPIN 1
#pragma RS232_BAUD 9600

int high;

void digit(int unit)
{
    char count;
    count = '0';
    while (high >= unit) {
        high = high - unit;
        count++;
    }
    putchar(count);
}

void main(void)
{
    char n, last, now;

    PORTB = 1;
    set_tris_b(0xFE);
    set_tris_a(0x1F);
    set_option(10101000b);
    while (1) {
        high = 0;
        last = 0;
        TMR0 = 0;
        for (n = 0; n < 250; n++) {
            delay_us(250); delay_us(250); delay_us(250); delay_us(250);
            delay_ms(3);
            now = TMR0;
            if (now < last) high = high + 256;
            last = now;
        }
        high = high + last;
        digit(10000);
        digit(1000);
        digit(100);
        digit(10);
        putchar('0' + high);
        putchar(13);
        putchar(10);
    }
}
