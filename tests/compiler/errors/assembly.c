char n;
void main(void) {
  // error: assembly: unknown instruction 'movlww'
  // hint: did you mean 'MOVLW'?
  asm movlww 5
  // error: assembly: 'm' is neither a register nor a variable
  asm movwf m
  // error: assembly: MOVF needs 1 operand, not 0
  asm movf
  // error: assembly: the literal 300 is outside 0 to 255
  asm movlw 300
  // error: assembly: MOVF takes at most 2 operands, not 3
  asm movf _n, W, 1
  // error: assembly: the destination is W or F, not '2'
  asm movf _n, 2
  // error: assembly: 'PORTB' is not a bit number from 0 to 7
  asm bsf _n, PORTB
  // error: assembly: 'RB0' is neither a register nor a variable
  asm movwf RB0
  // error: assembly: '_n + _n' is neither a register nor a variable
  asm movwf _n + _n
  // error: assembly: the register address 256 is outside 0 to 0xFF
  asm movwf 256
  // error: assembly: '_n * 2' is not a number from 0 to 255
  asm movlw _n * 2
  // error: assembly: '"two"' is not a number from 0 to 255
  asm movlw "two"
  // error: assembly: '7' is not a label
  asm goto 7
  // error: assembly: unmatched (
  asm movlw (3
}
