// dialect: xc8
#include <xc.h>
// what the warnings of meant_otherwise.c do not name
enum state { OFF, ON } state;
unsigned char a, b, list[4];
volatile unsigned char v;
int s;
unsigned int u;
struct point { unsigned char x, y, z; };
struct point zero = { 0 }, named = { .x = 1 }, full = { 1, 2, 3 };
struct { struct { unsigned char low, high; }; unsigned char after; } inner = { .low = 1, .high = 2 };
static volatile unsigned char watched;
static const unsigned char table[2] = { 1, 2 };
static void used(void) { a = 1; }
void ignored(unsigned char unit) { (void)unit; }
void in_assembly(unsigned char given) { asm("movf _given_in_assembly, w"); }
void conditions(void) {
  unsigned char i, c;
  while ((a = b)) b = 0;
  if (a && 1) b = 1;
  if (a != 1 && a != 2) b = 2;
  if (a < 3 || a > 7) b = 3;
  if (v == v || PORTA == PORTA) b = 4;
  v = v;
  PORTB = PORTB;
  if (s < 5 && u > 5 && (unsigned int)s < u && a < s) b = 5;
  if (((a || b) && s) || !a == !b) b = 6;
  u = (a << 1) + 1 | (b << 2 ^ 3);
  u = 3 ^ 8;
  for (i = 0; a < 4; a++) list[0] = i;
  for (i = 0; i < 4; ) { if (b) break; used(); }
  if (a) c = 1; else c = 2;
  b = c;
  if (a) { c = 1; } else { return; }
  b = c;
  switch (state) { case OFF: b = 1; break; case ON: b = 2; }
  switch (state) { case OFF: b = 1; break; default: b = 2; }
  if (a)
    b = 1;
  b = 2;
  if (a) b = 1;
         b = 2;
  (*list)++;
  u = sizeof list + table[1];
}
void main(void) {
  TRISB = 0;
  ignored(1);
  in_assembly(2);
  conditions();
  b = zero.x + named.y + full.z + inner.after;
}
