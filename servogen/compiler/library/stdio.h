#define EOF (-1)
#define NULL 0
#ifdef __XC8
void putch(unsigned char data);
#endif
#ifdef __SDCC
void putchar(unsigned char data);
#endif
void puts(const unsigned char *text);
