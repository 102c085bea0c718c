// error: the program needs 80 bytes of RAM, the chip has 68
char a[40];
char b[40];
void main(void) { a[0] = b[0]; }
