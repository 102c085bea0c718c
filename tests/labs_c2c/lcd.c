// Two lines of text on a HD44780 display with four data lines: RB4 to RB7, RS on RA0, E on RA1.
#pragma CLOCK_FREQ 4000000

const char first[] = "PIC16F84";
const char second[] = {'T', '=', 0};

void pulse(void)
{
    output_high_port_a(1);
    delay_us(2);
    output_low_port_a(1);
    delay_us(50);
}

void nibble(char value)
{
    PORTB = (PORTB & 0x0F) | (value << 4);
    pulse();
}

void command(char value)
{
    output_low_port_a(0);
    nibble(value >> 4);
    nibble(value & 0x0F);
    delay_ms(2);
}

void letter(char value)
{
    output_high_port_a(0);
    nibble(value >> 4);
    nibble(value & 0x0F);
}

void number(int value)
{
    letter('0' + value / 100);
    value = value % 100;
    letter('0' + value / 10);
    letter('0' + value % 10);
}

void setup(void)
{
    delay_ms(20);
    output_low_port_a(0);
    nibble(3);
    delay_ms(5);
    nibble(3);
    delay_us(200);
    nibble(3);
    nibble(2);                         // four data lines from now on
    command(0x28);                     // two lines
    command(0x0C);                     // display on
    command(0x01);                     // clear
    command(0x06);                     // move to the right
}

void main(void)
{
    char i;

    set_tris_a(0);
    set_tris_b(0);
    PORTA = 0;
    PORTB = 0;
    setup();
    for (i = 0; first[i] != 0; i++) letter(first[i]);
    command(0xC0);                     // second line
    for (i = 0; second[i] != 0; i++) letter(second[i]);
    number(237);
    while (1);
}
