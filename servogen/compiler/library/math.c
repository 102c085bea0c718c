// From this size on every value is a whole number.
#if __SIZEOF_FLOAT__ == 3
#define WHOLE 32768.0
#else
#define WHOLE 8388608.0
#endif

#define SIGN(u) u.bytes[sizeof(float) - 1]
union parts {
  float value;
  uint8_t bytes[sizeof(float)];
};

// defines: floor
float floor(float x) {
  union parts whole, given;
  if (!(__fabs(x) < WHOLE)) return x;  // infinities and what is not a number too
  whole.value = (int32_t)x;
  if (whole.value > x) whole.value -= 1;
  given.value = x;
  SIGN(whole) |= SIGN(given) & 0x80;  // of a zero: all others have it already
  return whole.value;
}

// defines: ceil
float ceil(float x) { return -floor(-x); }
