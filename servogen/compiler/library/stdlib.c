// defines: abs
int16_t abs(int16_t value) { return value < 0 ? -value : value; }

// defines: labs
int32_t labs(int32_t value) { return value < 0 ? -value : value; }

// defines: atoi
int16_t atoi(const unsigned char *text) {
  uint16_t value = 0;
  uint8_t negative = 0, c;
  while ((c = *text) == ' ' || (uint8_t)(c - '\t') < 5) text++;
  if (c == '-') negative = 1;
  if (c == '-' || c == '+') text++;
  while ((c = *text++ - '0') < 10) value = value * 10 + c;
  return negative ? -value : value;
}

// defines: atol
int32_t atol(const unsigned char *text) {
  uint32_t value = 0;
  uint8_t negative = 0, c;
  while ((c = *text) == ' ' || (uint8_t)(c - '\t') < 5) text++;
  if (c == '-') negative = 1;
  if (c == '-' || c == '+') text++;
  while ((c = *text++ - '0') < 10) value = value * 10 + c;
  return negative ? -value : value;
}

static uint32_t random_state = 1;

// defines: srand
void srand(uint16_t seed) { random_state = seed; }

// defines: rand
// The generator of ISO C 7.22.2.
int16_t rand(void) {
  random_state = random_state * 1103515245UL + 12345;
  return (uint16_t)(random_state >> 16) & 0x7FFF;
}

#define DIGIT(d) ((d) < 10 ? '0' + (d) : 'a' - 10 + (d))

// Writes the digits from the last to the first, then reverses them.
static void reversed(unsigned char *text, unsigned char *end) {
  *end = 0;
  while (text < --end) {
    uint8_t c = *text;
    *text++ = *end;
    *end = c;
  }
}

// SDCC's functions have another name and order of parameters, and no result.
#ifdef __SDCC
#define TO_TEXT(name, sdcc_name, type) void sdcc_name(type value, unsigned char *text, unsigned char base)
#define WRITE(name, sdcc_name, text, value, base) sdcc_name(value, text, base)
#define DONE
#else
#define TO_TEXT(name, sdcc_name, type) unsigned char *name(unsigned char *text, type value, uint8_t base)
#define WRITE(name, sdcc_name, text, value, base) name(text, value, base)
#define DONE return text;
#endif

// defines: utoa
// defines: _uitoa
TO_TEXT(utoa, _uitoa, uint16_t) {
  unsigned char *end = text;
  do {
    uint8_t digit = value % base;
    *end++ = DIGIT(digit);
    value /= base;
  } while (value);
  reversed(text, end);
  DONE
}

// defines: itoa
// defines: _itoa
TO_TEXT(itoa, _itoa, int16_t) {
  unsigned char *digits = text;
  uint16_t size = value;
  if (value < 0) {
    *digits++ = '-';
    size = -size;
  }
  WRITE(utoa, _uitoa, digits, size, base);
  DONE
}

// defines: ultoa
// defines: _ultoa
TO_TEXT(ultoa, _ultoa, uint32_t) {
  unsigned char *end = text;
  do {
    uint8_t digit = value % base;
    *end++ = DIGIT(digit);
    value /= base;
  } while (value);
  reversed(text, end);
  DONE
}

// defines: ltoa
// defines: _ltoa
TO_TEXT(ltoa, _ltoa, int32_t) {
  unsigned char *digits = text;
  uint32_t size = value;
  if (value < 0) {
    *digits++ = '-';
    size = -size;
  }
  WRITE(ultoa, _ultoa, digits, size, base);
  DONE
}
