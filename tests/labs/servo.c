//servo.c
//-----
//PB0 – pin la care se conecteaza SERVO
//
# pragma CLOCK_FREQ 4000000 //declararea frecventei oscillatorului
//-----
//-----
void stanga(int cicle)      //definirea unei functii pentru pozitia limita stanga
{
char a;
a=0x01;           //declararea (deschiderea) pinului de comanda, în HEX
while(cicle)
{
PORTB=a;
delay_ms(1);      //latimea impulsului pentru pozitia limita stanga
PORTB=0x00;        //închiderea tuturor porturilor
delay_ms(18);      //timpul dintre două impulsuri
cicle--;
}
}
//-----
//-----
void dreapta(int cicle)      //definirea unei functii pentru pozitia limita dreapta
{
char a;
a=0x01;           //declararea (deschiderea) pinului de comanda, în HEX
while(cicle)
{
PORTB=a;
delay_ms(2);      //latimea impulsului pentru pozitia limita stanga
PORTB=0x00;        //închiderea tuturor porturilor
delay_ms(18);      //timpul dintre două impulsuri
cicle--;
}
}
//-----
//-----
main(void)
{
set_bit( STATUS, RP0 );
TRISB=0x00;
clear_bit(STATUS, RP0 );
while(1)
{
stanga(100);           //apelarea functiei stanga (100 cicluri - impulsuri)
delay_s(5);            //pauza, 5 secunde
dreapta(100);          //apelarea functiei dreapta (100 cicluri - impulsuri)
delay_s(5);            //pauza, 5 secunde
}
}
