// Bits with addresses, constants in rom, further built-in functions of C2C and BoostC.
// clock: 4000000
// expect: seen == 2
// expect: low == 0
// expect: second == 98
// expect: third == 30
// expect: kept == 9
// expect: length == 4
#pragma DATA 0x2007, 0x3FF1
bit led@PORTB.2;
unsigned char flags;
bit ready@flags.1;
rom char *text = "abc";
rom char *numbers = { 10, 20, 30 };
char seen, low, second, third, kept, length;
char size(rom char *s) { char n = 0; while (*s++) n++; return n + 1; }
void main(void) {
  set_tris_b(0);
  output_port_b(0);
  led = 1;
  ready = 1;
  seen = flags;
  low = input_pin_port_b(1);
  if (!input_pin_port_b(2)) seen = 100;
  second = text[1];
  third = numbers[2];
  eeprom_write(5, 9);
  kept = eeprom_read(5);
  length = size(text);
  PORTB = 1;
  delay_100us(2);
// cycles: 202
  PORTB = 2;
}
