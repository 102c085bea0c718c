// Macros that stand for numbers, registers and bits are understood in every form of assembly, each use by
// the definition that holds there.
// expect: a == 0x2C
// expect: b == 9
// expect: c == 7
// expect: d == 12
// expect: e == 1
#define LED 3
#define AGAIN 5U
#define BOTH (AGAIN - 3 + LED)
#define FILE TMR0
#define F 3579545
#define BIT FSR, BOTH
#define COUNTED asm movlw LED
char a, b, c, d, e;
void main(void)
{
  a = 0;
  asm bsf _a,LED      ; LED of the port
  asm clrf FSR
  asm bsf BIT
  asm movf FSR, W
  asm iorwf _a, F
#undef LED
#define LED 2
  asm { bsf _a, LED // LED
  }
#undef AGAIN
#define AGAIN 9
  asm("movlw AGAIN\nmovwf _b");
  COUNTED
#undef LED
#define LED 7
  COUNTED
  asm movwf _c
  asm movlw LED + AGAIN - 4
  asm movwf FILE
  asm movf FILE, W
  asm movwf _d
#asm
  clrf _e
AGAIN: goto LAST
  nop
LAST:
  incf _e, F
#endasm
}
