// The program goes on at address 0; RA1 is an input that nothing drives, the EEPROM keeps what it holds.
// expect: rounds == 3
// expect: low == 0
char rounds, low;
void main(void) {
  char n = eeprom_read(0) + 1;
  if (n > 3) n = 1;
  eeprom_write(0, n);
  low = input_pin_port_a(1);
  if (n < 3) reset();
  rounds = n;
}
