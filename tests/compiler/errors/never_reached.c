// What stands behind an endless loop, a jump, or an 'if' whose two ways leave.
// dialect: xc8
unsigned char a;
unsigned char both(unsigned char n) {
  if (n) return 1;
  else { a = 2; return 2; }
  // warning: this is never reached
  a = 3;
}
void forever(void) {
  do {
    switch (a) { case 1: break; default: a = 1; }
    while (a) break;
  } while (1);
  // warning: this is never reached
  a = 4;
}
void ends(void) {
  while (1) {
    a++;
    if (a == 9) break;
    continue;
    // warning: this is never reached
    a = 5;
  }
  a = 6;
  for (;;) if (a) goto out;
out:
  a = 7;
}
int main(void) {
  a = both(1);
  ends();
  if (a) forever();
  for (;;) a++;
  return 0;
}
