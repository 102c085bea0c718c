// expect: taken == 7
// expect: kept == 7
// Equal ends of three branches are merged twice, each time behind a label of its own.
char left;
char other = 7;
char taken;
char kept;

char chosen(void)
{
    left -= 1;
    return left ? (left ? other : 1) : other;
}

void main(void)
{
    left = 0;
    taken = chosen();
    left = 1;
    kept = chosen();
    while (1);
}
