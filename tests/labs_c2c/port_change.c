// Four switches on RB4 to RB7; a change wakes the interrupt, and RA0 to RA3 follow them. RB0 counts changes.
#pragma CLOCK_FREQ 4000000

char keys;
char changed;

void interrupt(void)
{
    if (INTCON & 1) {                  // RBIF: cleared only after port B was read
        keys = PORTB >> 4;
        changed = 1;
        clear_bit(INTCON, RBIF);
    }
}

void main(void)
{
    set_tris_a(0);
    set_tris_b(11110000b);
    PORTB = 0;
    PORTA = 0;
    keys = 0;
    changed = 0;
    keys = PORTB;
    clear_bit(INTCON, RBIF);
    enable_interrupt(RBIE);
    enable_interrupt(GIE);
    for (;;) {
        if (changed) {
            changed = 0;
            PORTA = keys;
            toggle_bit(PORTB, 0);
        }
    }
}
