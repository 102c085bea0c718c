char n;
void main(void) {
  // error: assembly: 'movlww' is not an instruction of this chip
  // hint: did you mean 'MOVLW'?
  asm movlww 5
  // error: assembly: 'm' is neither a register nor a variable
  asm movwf m
  // error: assembly: MOVF takes 2 operands, not 0
  asm movf
  // error: assembly: the literal 300 is not 0 to 255
  asm movlw 300
}
