// A digit on port B, segments a to g on RB0 to RB6, common cathode: counts 0 to 9 every 250 ms.
#pragma CLOCK_FREQ 4000000

const char digits[10] = {
    00111111b, 00000110b, 01011011b, 01001111b, 01100110b,
    01101101b, 01111101b, 00000111b, 01111111b, 01101111b
};

char n;

void show(char digit)
{
    output_port_b(digits[digit]);
}

main()
{
    set_tris_b(0x00);
    n = 0;
    while (1) {
        show(n);
        delay_ms(250);
        n++;
        if (n == 10) n = 0;
    }
}
