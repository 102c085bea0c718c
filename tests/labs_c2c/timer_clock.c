// A clock: timer 0 interrupts every 4 ms (250 counts of 16 us), 250 of them are a second.
// RB0 changes every second; RA0 to RA3 show the seconds modulo 10.
#pragma CLOCK_FREQ 4000000

char ticks;
char seconds;

void interrupt(void)
{
    TMR0 = TMR0 + 6;                   // 256 - 250 counts from the overflow on
    clear_bit(INTCON, T0IF);
    ticks++;
    if (ticks == 250) {
        ticks = 0;
        seconds++;
        if (seconds == 10) seconds = 0;
        PORTA = seconds;
        PORTB = PORTB ^ 1;
    }
}

void main(void)
{
    set_tris_a(0);
    set_tris_b(0);
    PORTA = 0;
    PORTB = 0;
    ticks = 0;
    seconds = 0;
    set_option(11010011b);             // timer from the clock, 1:16
    TMR0 = 6;
    INTCON = 10100000b;                // GIE, T0IE
    while (1) clear_wdt();
}
