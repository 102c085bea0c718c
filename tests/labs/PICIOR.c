// PICIOR.c
//
#ifndef _CLOCK_FREQ
#define _CLOCK_FREQ 4000000
#endif
//char a;
//a=0x01; // PB0 - MOTOR 2_V PORT
//char b;
//b=0x02; // PB1 - MOTOR 2_H PORT
//
//-----
//-----
void f1(int cicle)
{
    while(cicle)
    {
        PORTB=0x01;
        delay_ms(1);          // MOTOR 2_V JOS, DELAY FOR "1" SIGNAL
        delay_us(250);
        delay_us(250);
        PORTB=0x02;
        delay_ms(1);          // MOTOR 2_H SPATE, DELAY FOR "1" SIGNAL
        delay_us(250);
        PORTB=0x00;
        delay_ms(40);         // DELAY FOR "0" SIGNAL
        cicle--;
    }
}
//-----
//-----
void f2(int cicle)      //
{
    while(cicle)
    {
        PORTB=0x01;
        delay_us(250);      // MOTOR 2_V SUS, DELAY FOR "1" SIGNAL
        delay_us(250);
        PORTB=0x02;
        delay_ms(1);          // MOTOR 2_H SPATE, DELAY FOR "1" SIGNAL
        delay_us(250);
        PORTB=0x00;
        delay_ms(40);         // DELAY FOR "0" SIGNAL
        delay_us(250);
        delay_us(250);
        delay_us(250);
        delay_us(250);
        delay_us(150);
        cicle--;
    }
}
//-----
//-----
main(void)
{
set_bit(STATUS, RP0);
TRISB=0x00;
clear_bit(STATUS, RP0);
//
//
while(1)
{
f1(20);           // JOS_SPATE
f2(20);           // SUS_SPATE
}
}
