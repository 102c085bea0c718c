#pragma RS232_TXPORT 0x06
#pragma RS232_TXPIN 1
#pragma RS232_BAUD 9600
void main(void) {
  // error: the clock frequency is not known
  // hint: write '#pragma CLOCK_FREQ 4000000' or '#define _XTAL_FREQ 4000000', or give --clock-hz
  delay_ms(1);
  // error: the clock frequency is not known
  // hint: write '#pragma CLOCK_FREQ 4000000' or '#define _XTAL_FREQ 4000000', or give --clock-hz
  putchar(65);
}
