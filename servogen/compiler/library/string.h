#define NULL 0
void *memcpy(void *to, const void *from, uint8_t size);
void *memmove(void *to, const void *from, uint8_t size);
void *memset(void *to, unsigned char value, uint8_t size);
int8_t memcmp(const void *left, const void *right, uint8_t size);
unsigned char *strcpy(unsigned char *to, const unsigned char *from);
unsigned char *strncpy(unsigned char *to, const unsigned char *from, uint8_t size);
unsigned char *strcat(unsigned char *to, const unsigned char *from);
unsigned char *strncat(unsigned char *to, const unsigned char *from, uint8_t size);
int8_t strcmp(const unsigned char *left, const unsigned char *right);
int8_t strncmp(const unsigned char *left, const unsigned char *right, uint8_t size);
uint8_t strlen(const unsigned char *text);
unsigned char *strchr(unsigned char *text, unsigned char wanted);
unsigned char *strrchr(unsigned char *text, unsigned char wanted);
unsigned char *strstr(unsigned char *text, const unsigned char *wanted);
void *memchr(void *from, unsigned char wanted, uint8_t size);
