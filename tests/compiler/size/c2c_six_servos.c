// Six servos on RB0 to RB5: each moves a step of 10 us a frame towards its goal; goals change on RA0.
#pragma CLOCK_FREQ 4000000

const char goals[2][6] = {{50, 20, 80, 50, 20, 80}, {10, 90, 50, 90, 10, 50}};
char now[6];

void pulse(char servo)
{
    char n, mask;
    mask = 1 << servo;
    PORTB = mask;
    delay_us(250); delay_us(250); delay_us(250); delay_us(250);
    for (n = now[servo]; n != 0; n--) nop();
    PORTB = 0;
}

void main(void)
{
    char servo, set;

    set_tris_a(0x1F);
    set_tris_b(0);
    PORTB = 0;
    for (servo = 0; servo < 6; servo++) now[servo] = 50;
    while (1) {
        set = PORTA & 1;
        for (servo = 0; servo < 6; servo++) {
            if (now[servo] < goals[set][servo]) now[servo]++;
            else if (now[servo] > goals[set][servo]) now[servo]--;
            pulse(servo);
        }
        delay_ms(9);
    }
}
