// expect: sixth == 6
// expect: cleared == 0
// expect: odd == 1
// expect: flag == 1
// expect: rounds == 6
// expect: once == 1
// expect: sum == 30
// expect: masked == 0xFF7F
// expect: minus == -1
// expect: three == 3
// expect: counted == 6
// expect: again == 0x01020304
// What random programs once showed, each smaller than it was found.
#include <stdint.h>

struct pair { uint8_t a; uint16_t b; };       // declared alone at file level
union both { uint16_t whole; uint8_t part[2]; };

uint8_t sixth, odd, rounds, once, sum;
signed char zero;
uint16_t words[2] = {0x8000, 0x1234}, cleared;
bool flags[3] = {0, 1, 0}, flag;
const uint8_t table[4] = {3, 7, 9, 11};
union both two;
uint32_t masked = 0x1234FFFF;
struct { signed char sign : 1; unsigned char three : 3; } narrow;
int minus, three;
uint32_t again;
uint8_t counted, seen;

static uint8_t added(const uint8_t *from, uint8_t count)
{
    uint8_t found = 0;
    while (count--)
        found += *from++;
    return found;
}

// warning: the parameter 'other' is never used
static uint32_t before(uint32_t other, uint32_t value)
{
    return value--;                            // the step is dropped, its result is not
}

static uint8_t never(uint8_t index)
{
    switch (0) {
    case 8:
        return table[index];
    }
    return 0;
}

void main(void)
{
    uint8_t index = 0, turns = 6, inner;

    EEADR = 4;                                 // the number of FSR: a constant is no register
    FSR = 4;
    sixth = FSR + 2;
    two.whole = 0x0101;
    words[index & 1] = 0;                      // both bytes through INDF, which is register 0
    cleared = words[0];
    odd = (bit)(two.whole + 2);
    flags[two.part[0]] |= 4;                   // a bool stays 0 or 1
    flags[two.part[1]] -= 0;
    flag = flags[1];
L1: rounds++;                                  // not a label of the compiler's own
    for (inner = 0; inner < 2; inner++)
        once = (flag || 0) + (0 ^ (inner > 5));
    if (--turns) goto L1;
    sum = added(table, 4) + never(index);      // read by address only, for the other reading is dropped
    masked &= ~(1U << 7);                      // 16 bits wide, so the upper ones go
    zero = 0;
    minus = (narrow.sign = 1) + zero;          // an assignment's value is what the field holds then
    for (inner = 6; inner; inner--) {          // the value that is chosen is not the counter
        counted++;
        seen |= (counted ? counted : inner) < 1;
    }
    again = before(0, 0x01020304);
    // warning: 11 does not fit a bit-field of 3 bits
    three = (narrow.three = 0x0B) + zero;
}
