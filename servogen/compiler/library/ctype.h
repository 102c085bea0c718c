unsigned char isdigit(unsigned char c);
unsigned char isxdigit(unsigned char c);
unsigned char isupper(unsigned char c);
unsigned char islower(unsigned char c);
unsigned char isalpha(unsigned char c);
unsigned char isalnum(unsigned char c);
unsigned char isspace(unsigned char c);
unsigned char iscntrl(unsigned char c);
unsigned char isgraph(unsigned char c);
unsigned char isprint(unsigned char c);
unsigned char ispunct(unsigned char c);
#ifdef __SDCC
int16_t toupper(int16_t c);
int16_t tolower(int16_t c);
#else
unsigned char toupper(unsigned char c);
unsigned char tolower(unsigned char c);
#endif
