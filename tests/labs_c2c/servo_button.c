// A servo on RB0: 1 ms while the button on RA2 is open, 2 ms while it is pressed, every 20 ms.
#pragma CLOCK_FREQ 4000000

void left(void)
{
    set_bit(PORTB, 0);
    delay_us(250); delay_us(250); delay_us(250); delay_us(250);
    clear_bit(PORTB, 0);
    delay_ms(19);
}

void right(void)
{
    set_bit(PORTB, 0);
    delay_ms(2);
    clear_bit(PORTB, 0);
    delay_ms(18);
}

void main(void)
{
    set_tris_a(0x1F);
    set_tris_b(0);
    PORTB = 0;
    while (1) {
        if (test_bit(PORTA, 2)) left();
        else right();
    }
}
