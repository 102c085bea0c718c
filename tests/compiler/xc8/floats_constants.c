// Literals are rounded to the nearest value of 24 bits, and constant expressions are computed as the program would.
// expect: tenth == 0x3DCCCD
// expect: large == 0x477FFF
// expect: least == 0x000001
// expect: hex == 0xC10C00
// expect: point == 0x40A000
// expect: folded == 0x404000
// expect: infinite == 0xFF8000
// expect: tie == 0x4B8000
// expect: true_ones == 21
// expect: cut == -3
// expect: table_sum == 0x40D000
// expect: chosen == 0x402000
// expect: minus == 0x800000
#include <xc.h>
float tenth, large, least, hex, point;
double folded, infinite, table_sum, chosen, minus;
long double tie;
unsigned char true_ones;
int cut;
const float table[] = { 0.5, 1, 5 };
const float half = 0.5;
void main(void) {
  unsigned char i;
  const double two = 2;
  tenth = .1;
  large = 65535.4e0;
  least = 3.6e-43f;
  hex = -0x1.18p3L;
  point = 5.e0;
  folded = 1.5 * 4 / 2;
  infinite = -1.0 / 0;
  minus = -0.0;
  // needs 24 bits of mantissa: the even neighbour is 2 to the 24
  // warning: 16777215 has more digits than 'float' and becomes 16777216
  tie = 16777215;
  true_ones = (0.1 < 0.2) + (0.0 == -0.0) * 4 + !0.0 * 16 + (1.0 > 2) + (0.0 / 0 == 0.0 / 0);
  cut = (int)-3.99;
  for (i = 0; i < 3; i++) table_sum += table[i];
  chosen = table_sum ? half + two : half;
  while (1);
}
