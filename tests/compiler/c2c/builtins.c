// The built-in functions of C2C on registers, without the user's own bank switching.
#pragma CLOCK_FREQ 4000000
// expect: x == 0x81
// expect: y == 1
// expect: z == 0x55
char x, y, z;
main() {
  set_tris_b(00000000b);
  set_tris_a(0x1f);
  output_port_b(0xAA);
  output_high_port_b(0);
  output_low_port_b(7);
  set_bit(x, 7);
  set_bit(x, 0);
  set_bit(x, 3);
  clear_bit(x, 3);
  if (test_bit(x, 7)) y = 1;
  toggle_bit(y, 1);
  toggle_bit(y, 1);
  z = 01010101b;
  set_option(0x07);
  enable_interrupt(T0IE);
  disable_interrupt(T0IE);
  nop();
  clear_wdt();
}
