// Structures as results, whole and by their members.
// expect: a == 24
// expect: b == 2
// expect: c == 15
struct pair {
    unsigned char first;
    int second;
};
int a, c;
unsigned char b;

struct pair make(unsigned char x)
{
    struct pair found;
    found.first = x;
    found.second = x * 3;
    return found;
}

void main(void)
{
    struct pair whole = make(5);
    a = make(7).second + make(1).second;
    b = make(2).first;
    c = whole.second;
}
