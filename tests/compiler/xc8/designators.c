// ISO C99 6.7.8: an initialiser without a designator fills the element behind the last one; the length is that of the largest index.
// expect: length == 2
// expect: first == 3
// expect: second == 7
// expect: longer == 5
// expect: last == 9
// expect: after == 6
// expect: again == 8
// warning: this element already has a value
unsigned char back[] = { [1] = 5, [0] = 3, 7 };
unsigned char far_off[] = { [4] = 9, [1] = 4, 6 };
// warning: this element already has a value
const unsigned char twice[] = { 1, [0] = 8 };
unsigned char length, first, second, longer, last, after, again;
void main(void) {
  length = sizeof back;
  first = back[0];
  second = back[1];
  longer = sizeof far_off;
  last = far_off[4];
  after = far_off[2];
  again = twice[0] + sizeof twice - 1;
}
