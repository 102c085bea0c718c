#pragma CLOCK_FREQ 3579545
void main(void) {
  // warning: 100 µs is not a whole number of cycles at 3579545 Hz: 89 cycles are 99.45398088 µs
  delay_us(100);
}
