// Start values of bit-fields: constant for globals, any for locals; members that are not given are 0.
// expect: global == 0x75
// expect: second == 0xB3
// expect: local == 0xEF
// expect: named == 0x1A
// expect: braces == 0x97
struct fields {
    unsigned a : 2;
    unsigned b : 3;
    unsigned char c;
    unsigned d : 1;
};
struct fields one = {1, 5, 3, 1}, list[2] = {{1, 2, 3, 1}, {3, 4, 5, 0}};
unsigned char n = 3, global, second, local, named, braces;

void main(void)
{
    struct fields mine = {n, n, 7, n};
    struct fields by_name = {.b = 6};
    struct fields zero = {{0}}, inner = {{3}, {n + 2}, {4}, {1}};
    global = one.a | one.b << 2 | one.c << 5 | one.d << 4;
    second = list[1].a | list[1].b << 2 | list[1].c << 5 | list[1].d;
    local = mine.a | mine.b << 2 | mine.c << 5 | mine.d;
    braces = inner.a + zero.a + zero.b + zero.c | inner.b << 2 | inner.c << 5 | inner.d << 7;
    named = by_name.a | by_name.b << 2 | by_name.c << 5 | n - 1;
}
