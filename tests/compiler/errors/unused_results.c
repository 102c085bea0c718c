// dialect: xc8
unsigned char count;
// warning: 'record' has 3 bytes and is shared with the interrupt, which can occur between two of them
struct { unsigned char byte; int word; } record;

unsigned char next(unsigned char x)
{
    return x + count;
}

unsigned char counted(void)
{
    return ++count;
}

// warning: this interrupt function is never called: GIE is never set
void __interrupt() each(void)
{
    record.byte++;
    record.word++;
    T0IF = 0;
}

void main(void)
{
    signed char narrow;
    // warning: the result of 'next' is not used, and the call has no other effect
    next(2);
    counted();
    // warning: the result of this expression is not used
    eeprom_read(1);
    // warning: 200 does not fit 'signed char' and becomes -56
    narrow = 200;
    record.word = narrow;
    PORTB;
}
