// dialect: xc8
enum bytes { B0, B255 = 255 };
enum words { W0, W65535 = 0xFFFF };
enum numbers { N0 = -32768, N1 = 32767 };
enum words w = W65535;
enum numbers n = N0;
char sizes[sizeof(enum bytes) == 1 && sizeof(enum words) == 2 && sizeof(enum numbers) == 2 ? 1 : -1];
// error: the enumeration constant 'L1' is 65536
// hint: an enumeration holds 0 to 65535 or -32768 to 32767
enum longer { L0 = 0xFFFF, L1 };
// error: the enumeration constant 'M1' is 32768
// hint: an enumeration holds 0 to 65535 or -32768 to 32767
enum mixed { M0 = -1, M1 = 32768 };
// error: the enumeration constant 'S1' is -32769
// hint: an enumeration holds 0 to 65535 or -32768 to 32767
enum small { S0, S1 = -32769 };
void main(void) { w = n == N1 ? W0 : W65535; }
