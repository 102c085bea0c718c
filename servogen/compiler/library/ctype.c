// defines: isdigit
unsigned char isdigit(unsigned char c) { return (uint8_t)(c - '0') < 10; }

// defines: isupper
unsigned char isupper(unsigned char c) { return (uint8_t)(c - 'A') < 26; }

// defines: islower
unsigned char islower(unsigned char c) { return (uint8_t)(c - 'a') < 26; }

// defines: isalpha
unsigned char isalpha(unsigned char c) { return (uint8_t)((c | 0x20) - 'a') < 26; }

// defines: isalnum
unsigned char isalnum(unsigned char c) {
  return (uint8_t)((c | 0x20) - 'a') < 26 || (uint8_t)(c - '0') < 10;
}

// defines: isxdigit
unsigned char isxdigit(unsigned char c) {
  return (uint8_t)(c - '0') < 10 || (uint8_t)((c | 0x20) - 'a') < 6;
}

// defines: isspace
unsigned char isspace(unsigned char c) { return c == ' ' || (uint8_t)(c - '\t') < 5; }

// defines: iscntrl
unsigned char iscntrl(unsigned char c) { return c < ' ' || c == 0x7F; }

// defines: isgraph
unsigned char isgraph(unsigned char c) { return (uint8_t)(c - '!') < 94; }

// defines: isprint
unsigned char isprint(unsigned char c) { return (uint8_t)(c - ' ') < 95; }

// defines: ispunct
unsigned char ispunct(unsigned char c) { return isgraph(c) && !isalnum(c); }

// defines: toupper
unsigned char toupper(unsigned char c) { return (uint8_t)(c - 'a') < 26 ? c & 0xDF : c; }

// defines: tolower
unsigned char tolower(unsigned char c) { return (uint8_t)(c - 'A') < 26 ? c | 0x20 : c; }
