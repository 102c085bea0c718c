// Binary constants of any number of digits; the ports read by functions; comments behind assembly.
// expect: one == 1
// expect: five == 5
// expect: top == 0x8000
// expect: padded == 3
// expect: a == 2
// expect: b == 0x0A
// expect: w == 9
char one, five, a, b, w;
int top, padded;
main() {
  one = 1b;
  five = 101b;
  top = 1000000000000000b;
  padded = 00000000000000000011b;
  set_tris_a(0);
  set_tris_b(0);
  output_port_a(00110b);
  output_low_port_a(2);
  a = input_port_a();
  output_port_b(1111b);
  output_low_port_b(0);
  output_low_port_b(2);
  b = input_port_b();
  asm movlw 9 /* nine */
  asm movwf _w // kept
}
