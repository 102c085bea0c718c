// The program's own RP0 bracket and the compiler's switches live together.
// expect: a == 0x5A
// expect: b == 0x0F
// expect: c == 2
// expect: d == 0x33
// expect: e == 1
// expect: f == 0x77
// expect: g == 1
// expect: h == 0x05
#pragma CLOCK_FREQ 4000000
char a, b, c, d, e, f, g, h, zero;
void directions(void)
{
  TRISB = 0x0F;
  PORTB = 0xA0;
}
void main(void)
{
  PORTB = 0x50;
  set_bit(STATUS, RP0);
  TRISB = 0x00;
  TRISA = 0x00;
  PORTA = 0x0A;
  a = PORTA | PORTB;
  directions();
  b = TRISB;
  if (PORTB & 0x80) c = 1;
  c++;
  // warning: RA4 is an open-drain output: it is high only with a pull-up resistor
  if (c == 2) set_bit(PORTA, 4);
  EEADR = 0x33;
  clear_bit(STATUS, RP0);
  d = EEADR;
  STATUS = 0x20;
  PORTB = 0x77;
  if (test_bit(TRISB, 0)) e = 1;
  STATUS = 0;
  TRISB = 0;
  f = PORTB;
  TRISB = 0x01;
  if (test_bit(TRISB, 0)) g++;
  if (test_bit(TRISB, 1)) g++;
  if (!zero) set_bit(TRISB, 2);
  if (!f) set_bit(TRISB, 3);
  h = TRISB;
}
