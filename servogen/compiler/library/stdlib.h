#define EXIT_SUCCESS 0
#define EXIT_FAILURE 1
#define NULL 0
#define RAND_MAX 32767
int16_t abs(int16_t value);
int32_t labs(int32_t value);
int16_t atoi(const unsigned char *text);
int32_t atol(const unsigned char *text);
int16_t rand(void);
void srand(uint16_t seed);
#ifdef __SDCC
void _uitoa(uint16_t value, unsigned char *text, unsigned char base);
void _itoa(int16_t value, unsigned char *text, unsigned char base);
void _ultoa(uint32_t value, unsigned char *text, unsigned char base);
void _ltoa(int32_t value, unsigned char *text, unsigned char base);
#else
unsigned char *utoa(unsigned char *text, uint16_t value, uint8_t base);
unsigned char *itoa(unsigned char *text, int16_t value, uint8_t base);
unsigned char *ultoa(unsigned char *text, uint32_t value, uint8_t base);
unsigned char *ltoa(unsigned char *text, int32_t value, uint8_t base);
#endif
