// The operands and the special mnemonics of the assembler: a variable and a computed offset, `low` and `high` of an
// address, numbers in each notation, registers of bank 1 by their whole address, branches on a flag.
// expect: second == 4
// expect: third == 6
// expect: through == 9
// expect: bits == 0xA5
// expect: option == 0x81
// expect: high_part == 0
// expect: turns == 3
// expect: compared == 2
// expect: skipped == 0
char pair[3], second, third, through, bits, option, high_part, turns, compared, skipped;
void main(void)
{
  asm {
    movlw 4
    movwf _pair + (3 - 2)
    movlw .6
    movwf 1 + 1 + _pair
    movlw low(_through)
    movwf FSR
    movlw D'9'
    movwf INDF
    movlw high(_through)   // C's comment
    movwf _high_part
    movlw 0b10100000 | H'05'
    movwf _bits
    movlw OPTION_REG       ; the bank is bit 7: with FSR it is part of the address
    movwf _option
    clrf _turns
again
    incf _turns, F
    movlw 3
    subwf _turns, W
    bnz again
    movlw 1
    movwf _compared
    tstf _compared
    skpz
    incf _compared
    clrf _skipped
    b over
    incf _skipped, f
over:
    nop
  }
  second = pair[1];
  third = pair[2];
}
