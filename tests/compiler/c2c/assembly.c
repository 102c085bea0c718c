// asm to the end of the line and in braces; names of globals and locals; labels.
// expect: g == 5
// expect: h == 12
char g, h;
void twice(char n)
{
  char r;
  asm {
    movf _n_twice, W
    addwf _n_twice, W   ; n + n
    movwf _r_twice
  }
  h = r;
}
main()
{
  asm movlw 5
  asm movwf _g;
  asm nop
  twice(6);
  asm {
again:
    decfsz _g, F
    goto again
    movlw 5
    movwf _g
  }
}
