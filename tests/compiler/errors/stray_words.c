// dialect: xc8
// Words such as __at that belong to no name, or to one that cannot have them.
// error: 'kept' keeps its value through a reset and cannot be initialised
persistent unsigned char kept = 1;
// error: '__at' stands where no name is declared
void f(char __at(0x20));
// error: 'interrupt' stands where no function is declared
unsigned char interrupt flag;
unsigned char speed;
// warning: the section is ignored
unsigned char __section("mine") mine;
void main(void) { mine = speed; }
