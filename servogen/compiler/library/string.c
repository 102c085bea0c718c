// Lengths are one byte: RAM has 68.
// defines: memcpy
void *memcpy(void *to, const void *from, uint8_t size) {
  uint8_t *target = to;
  const uint8_t *source = from;
  for (; size; size--) *target++ = *source++;
  return to;
}

// defines: memmove
void *memmove(void *to, const void *from, uint8_t size) {
  uint8_t *target = to;
  const uint8_t *source = from;
  if ((uint16_t)from > (uint16_t)(uint8_t)to) {
    for (; size; size--) *target++ = *source++;
  } else {
    while (size) {
      size--;
      target[size] = source[size];
    }
  }
  return to;
}

// defines: memset
void *memset(void *to, unsigned char value, uint8_t size) {
  uint8_t *target = to;
  for (; size; size--) *target++ = value;
  return to;
}

// defines: memcmp
int8_t memcmp(const void *left, const void *right, uint8_t size) {
  const uint8_t *one = left, *two = right;
  for (; size; size--) {
    uint8_t a = *one++, b = *two++;
    if (a != b) return a < b ? -1 : 1;
  }
  return 0;
}

// defines: memchr
void *memchr(void *from, unsigned char wanted, uint8_t size) {
  uint8_t *at = from;
  for (; size; size--) {
    if (*at == wanted) return at;
    at++;
  }
  return 0;
}

// defines: strcpy
unsigned char *strcpy(unsigned char *to, const unsigned char *from) {
  uint8_t *target = to;
  uint8_t byte;
  do {
    byte = *from++;
    *target++ = byte;
  } while (byte);
  return to;
}

// defines: strncpy
unsigned char *strncpy(unsigned char *to, const unsigned char *from, uint8_t size) {
  uint8_t *target = to;
  uint8_t byte = 1;
  for (; size; size--) {
    if (byte) byte = *from++;
    *target++ = byte;
  }
  return to;
}

// defines: strcat
unsigned char *strcat(unsigned char *to, const unsigned char *from) {
  uint8_t *target = to;
  uint8_t byte;
  while (*target) target++;
  do {
    byte = *from++;
    *target++ = byte;
  } while (byte);
  return to;
}

// defines: strncat
unsigned char *strncat(unsigned char *to, const unsigned char *from, uint8_t size) {
  uint8_t *target = to;
  uint8_t byte;
  while (*target) target++;
  for (; size; size--) {
    byte = *from++;
    if (!byte) break;
    *target++ = byte;
  }
  *target = 0;
  return to;
}

// defines: strcmp
int8_t strcmp(const unsigned char *left, const unsigned char *right) {
  uint8_t a, b;
  do {
    a = *left++;
    b = *right++;
  } while (a && a == b);
  return a == b ? 0 : a < b ? -1 : 1;
}

// defines: strncmp
int8_t strncmp(const unsigned char *left, const unsigned char *right, uint8_t size) {
  uint8_t a = 0, b = 0;
  for (; size; size--) {
    a = *left++;
    b = *right++;
    if (!a || a != b) break;
  }
  return a == b ? 0 : a < b ? -1 : 1;
}

// defines: strlen
uint8_t strlen(const unsigned char *text) {
  uint8_t length = 0;
  while (*text++) length++;
  return length;
}

// defines: strchr
unsigned char *strchr(unsigned char *text, unsigned char wanted) {
  for (;; text++) {
    if (*text == wanted) return text;
    if (!*text) return 0;
  }
}

// defines: strrchr
unsigned char *strrchr(unsigned char *text, unsigned char wanted) {
  unsigned char *last = 0;
  for (;; text++) {
    if (*text == wanted) last = text;
    if (!*text) return last;
  }
}

// defines: strstr
unsigned char *strstr(unsigned char *text, const unsigned char *wanted) {
  for (;; text++) {
    unsigned char *at = text;
    const unsigned char *sought = wanted;
    uint8_t byte;
    for (;;) {
      byte = *sought++;
      if (!byte) return text;
      if (*at != byte) break;
      at++;
    }
    if (!*text) return 0;
  }
}
