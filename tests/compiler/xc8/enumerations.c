// expect: high == 1
// expect: negative == 1
// expect: wide == 4
#include <xc.h>
enum words { W0, W1 = 0x8000, W2 = 0xFFFF };
enum numbers { N0 = -2, N1 = 300 };
volatile enum words w = W2;
volatile enum numbers n = N0;
unsigned char high, negative, wide;
void main(void) {
    high = w == W2 && w > W1;
    negative = n < 0 && n == N0;
    wide = sizeof(w) + sizeof(n);
    while (1);
}
