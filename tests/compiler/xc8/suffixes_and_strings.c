// expect: suffixes == 63
// expect: length == 15
#include <xc.h>
#if 0x7FFFFFFFFFFFFFFFLL > 0 && 1ll == 1LL
#define A 1
#endif
#if 5ULL == 5uLL && 10LLU - 11ll > 0
#define B 2
#endif
#if -1LL < 0 && -1ULL > 0
#define C 4
#endif
#define BIG 0x100000000LL
#if BIG >> 32 == 1
#define D 8
#endif
#if defined(LLONG_MAX) && LLONG_MAX == 9223372036854775807LL
#error there is no such type
#else
#define E 16
#endif
#if (10L) == 10 && 7lu == 7UL
#define F 32
#endif
char braced[] = {"SDCC"};
const char constant[] = {"ab"};
const char names[][3] = {"ab", "cd"};
unsigned char suffixes, length;
void main(void) {
    char local[] = {""};
    suffixes = A + B + C + D + E + F;
    length = sizeof(braced) + sizeof(constant) + sizeof(names) + sizeof(local);
    if (braced[3] != 'C' || braced[4] || constant[1] != 'b' || local[0]) length = 0;
    while (1);
}
