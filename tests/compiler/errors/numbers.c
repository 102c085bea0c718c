void main(void) {
  char a;
  // error: '12q' is not a number
  a = 12q;
  // error: '12uu' is not a number: unknown suffix 'uu'
  a = 12uu;
  // error: '089' is not a number: octal digits are 0 to 7
  a = 089;
  // error: a character constant holds one character
  a = 'ab';
}
