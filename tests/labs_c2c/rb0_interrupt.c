// Falling edges on RB0/INT are counted by the interrupt; RA0 to RA3 show the count.
#pragma CLOCK_FREQ 4000000

char count;

void interrupt(void)
{
    if (INTCON & 2) {                  // INTF
        count = count + 1;
        clear_bit(INTCON, INTF);
    }
}

void main(void)
{
    count = 0;
    set_tris_a(0);
    set_tris_b(0xFF);
    set_option(10000000b);             // no pull-ups, falling edge
    clear_bit(INTCON, INTF);           // what happened before does not count
    set_bit(INTCON, INTE);
    set_bit(INTCON, GIE);
    while (1)
        output_port_a(count & 0x0F);
}
