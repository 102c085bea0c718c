// Not an operand, because assembly does not read it as C does: octal numbers, expressions of variables, functions.
#define OCTAL 017
#define SUM (x + 1)
#define CALLED() 3
char x;
void main(void) {
  // error: assembly: 'OCTAL' is not a number from 0 to 255
  asm movlw OCTAL
  // error: assembly: 'SUM' is neither a register nor a variable
  asm movwf SUM
  // error: assembly: 'CALLED' is not a bit number from 0 to 7
  asm bsf _x, CALLED
  // error: assembly: 'LATER' is not a bit number from 0 to 7
  asm bsf _x, LATER
#define LATER 3
}
