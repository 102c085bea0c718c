// A function that returns with RP0 set leaves bank 1 to its callers; whether the compiler or the program switches,
// every register is reached.
// expect: port == 0x55
// expect: directions == 0x0F
// expect: either == 0x0A
// expect: tail == 0x33
// expect: without == 0
// expect: with == 0x33
char port, directions, either, tail, without, with;

void bank1(void)
{
    asm bsf STATUS,5
}

void bank0(void)
{
    asm bcf STATUS,5
}

void outer(void)
{
    bank1();
}

char maybe(char yes)
{
    if (yes) {
        asm bsf STATUS,5
    }
    return 1;
}

void write_port(void)
{
    PORTB = 0x33;
}

void leaves_by_a_jump(void)
{
    bank1();
    write_port();
}

void leaves_by_a_jump_if(char yes)
{
    bank1();
    if (yes) write_port();
}

void main(void)
{
    TRISB = 0;
    outer();
    PORTB = 0x55;
    asm movlw 0x0F
    asm movwf TRISA
    port = PORTB;
    bank0();
    directions = TRISA & 0x1F;
    maybe(port);
    PORTB = 0x0A;
    either = PORTB;
    bank0();
    leaves_by_a_jump();
    tail = PORTB;
    bank0();
    PORTB = 0;
    leaves_by_a_jump_if(without);
    without = PORTB;
    leaves_by_a_jump_if(1);
    with = PORTB;
}
