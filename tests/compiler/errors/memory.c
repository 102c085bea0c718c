// error: there is no memory at 0x60 for 1 byte
// hint: RAM is 0x0C to 0x4F
char outside @ 0x60;
// error: there is no memory at 0x4F for 2 bytes
unsigned int across @ 0x4F;
char last @ 0x4F;
char register_of_bank_1 @ 0x85;
char values[80];

void main(void)
{
    outside = across = last = register_of_bank_1 = values[1];
}
