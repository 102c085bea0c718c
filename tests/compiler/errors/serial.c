#pragma CLOCK_FREQ 4000000
#pragma RS232_TXPORT 0x06
#pragma RS232_TXPIN 1
#pragma RS232_BAUD 100000
void main(void) {
  // error: 100000 baud is too fast: a bit has only 10 cycles, 16 are needed
  putchar(65);
  // error: 'getchar' needs '#pragma RS232_RXPORT …'
  getchar();
}
