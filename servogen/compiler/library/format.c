// The parts of a format string, one call each: the compiler takes the string apart.
// `flags`: 1 left-justified, 2 padded with 0, 4 with the sign also of positive numbers, 8 a space in its place,
// 16 signed, 32 capital letters; the base is in `base`.
#ifdef TO_SPRINTF
#define NAME(x) __sprintf_##x
static unsigned char *out, *start;
#define PUT(c) *out++ = (c)

// defines: __sprintf_begin
void __sprintf_begin(unsigned char *text) { out = start = text; }

// defines: __sprintf_end
int16_t __sprintf_end(void) {
  *out = 0;
  return (uint8_t)(out - start);
}
#else
#define NAME(x) __printf_##x
#ifdef __XC8
void putch(unsigned char data);
#define SEND(c) putch(c)
#elif defined(__SDCC)
void putchar(unsigned char data);
#define SEND(c) putchar(c)
#else
#define SEND(c) putchar(c)
#endif
static uint8_t sent;
static void PUT(unsigned char c) {
  sent++;
  SEND(c);
}

// defines: __printf_begin
void __printf_begin(void) { sent = 0; }

// defines: __printf_end
int16_t __printf_end(void) { return sent; }

// defines: puts
void puts(const unsigned char *text) {
  uint8_t c;
  while ((c = *text++)) SEND(c);
  SEND('\n');
}
#endif

// defines: __sprintf_char
// defines: __printf_char
void NAME(char)(unsigned char c) { PUT(c); }

// defines: __sprintf_text
// defines: __printf_text
void NAME(text)(const unsigned char *text) {
  uint8_t c;
  while ((c = *text++)) PUT(c);
}

static void NAME(pad)(uint8_t count, unsigned char c) {
  for (; count; count--) PUT(c);
}

// defines: __sprintf_string
// defines: __printf_string
void NAME(string)(const unsigned char *text, uint8_t width, uint8_t left) {
  uint8_t length = 0;
  const unsigned char *end = text;
  while (*end++) length++;
  width = width > length ? width - length : 0;
  if (!left) NAME(pad)(width, ' ');
  NAME(text)(text);
  if (left) NAME(pad)(width, ' ');
}

#define LEFT 1
#define ZEROS 2
#define PLUS 4
#define SPACE 8
#define SIGNED 16
#define CAPITALS 32

static uint8_t length;
static unsigned char digits[11];  // the last one first

// Writes the digits, the sign and the padding.
static void NAME(field)(uint8_t width, uint8_t flags, unsigned char sign) {
  uint8_t used = sign ? length + 1 : length;
  width = width > used ? width - used : 0;
  if (!(flags & (LEFT | ZEROS))) NAME(pad)(width, ' ');
  if (sign) PUT(sign);
  if ((flags & (LEFT | ZEROS)) == ZEROS) NAME(pad)(width, '0');
  while (length) PUT(digits[--length]);
  if (flags & LEFT) NAME(pad)(width, ' ');
}

static void add_digit(uint8_t digit, uint8_t flags) {
  if (digit >= 10) digit += flags & CAPITALS ? 'A' - '0' - 10 : 'a' - '0' - 10;
  digits[length++] = '0' + digit;
}

// defines: __sprintf_unsigned
// defines: __printf_unsigned
// A number without a width: digits by the powers of ten, so that no buffer is needed.
void NAME(unsigned)(uint16_t value) {
  static const uint16_t powers[] = {10000, 1000, 100, 10};
  uint8_t at, shown = 0;
  for (at = 0; at < 4; at++) {
    uint16_t power = powers[at];
    uint8_t digit = '0';
    while (value >= power) {
      value -= power;
      digit++;
    }
    if (digit != '0') shown = 1;
    if (shown) PUT(digit);
  }
  PUT('0' + (uint8_t)value);
}

// defines: __sprintf_signed
// defines: __printf_signed
void NAME(signed)(int16_t value) {
  uint16_t size = value;
  if (value < 0) {
    PUT('-');
    size = -size;
  }
  NAME(unsigned)(size);
}

// defines: __sprintf_int
// defines: __printf_int
void NAME(int)(uint16_t value, uint8_t base, uint8_t width, uint8_t flags) {
  unsigned char sign = 0;
  if (flags & SIGNED) {
    if ((int16_t)value < 0) {
      sign = '-';
      value = -value;
    } else if (flags & PLUS) sign = '+';
    else if (flags & SPACE) sign = ' ';
  }
  length = 0;
  do {
    add_digit(value % base, flags);
    value /= base;
  } while (value);
  NAME(field)(width, flags, sign);
}

// defines: __sprintf_long
// defines: __printf_long
void NAME(long)(uint32_t value, uint8_t base, uint8_t width, uint8_t flags) {
  unsigned char sign = 0;
  if (flags & SIGNED) {
    if ((int32_t)value < 0) {
      sign = '-';
      value = -value;
    } else if (flags & PLUS) sign = '+';
    else if (flags & SPACE) sign = ' ';
  }
  length = 0;
  do {
    add_digit(value % base, flags);
    value /= base;
  } while (value);
  NAME(field)(width, flags, sign);
}
