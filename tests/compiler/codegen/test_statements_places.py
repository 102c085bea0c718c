"""Each instruction belongs to the line on which its statement begins, a loop's jumps to its first line."""

from __future__ import annotations

from itertools import groupby

from servogen.compiler import Options, Source, compile_sources

PROGRAM = """#include <xc.h>
#define _XTAL_FREQ 4000000
unsigned char a, b, c, n, array[4];
unsigned char get(unsigned char x) { return x; }
void f(void) {
  if (a)
    n++;
  else
    b++;
  while (c)
    c--;
  for (a = 1;
       a != b;
       a++)
    n = a;
  do
    n--;
  while (n);
  switch (a) {
    case 1:
      b = 2;
      break;
    default:
      c = 3;
  }
  a = get(
    b + 1);
  n = a ?
    b :
    c;
  array[b]
    = c;
  if (a &&
      b)
    return;
  goto end;
end:
  n = b
    + c;
  __delay_us(1);
  NOP();
}
void main(void) { f(); a = 1; }
"""
EXPECTED = [
    # the test and the jump around the first arm; the arm; the jump around the second one
    ("if (a)", "MOVF BTFSC GOTO"), ("n++;", "INCF"), ("if (a)", "GOTO"), ("b++;", "INCF"),
    ("while (c)", "MOVF BTFSC GOTO"), ("c--;", "DECF"), ("while (c)", "GOTO"),
    ("for (a = 1;", "MOVLW MOVWF MOVF XORWF BTFSC GOTO"),
    ("n = a;", "MOVF MOVWF"), ("a++)", "INCF"), ("for (a = 1;", "GOTO"), ("n--;", "DECF"),
    ("do", "MOVF BTFSS GOTO"),
    # the case, then the default
    ("switch (a) {", "MOVF XORLW BTFSC GOTO GOTO"),
    ("b = 2;", "MOVLW MOVWF"), ("break;", "GOTO"), ("c = 3;", "MOVLW MOVWF"),
    ("a = get(", "MOVLW ADDWF CALL MOVWF"),
    ("n = a ?", "MOVF BTFSC GOTO MOVF MOVWF GOTO MOVF MOVWF"),
    ("array[b]", "MOVF ADDLW MOVWF MOVF MOVWF"),
    ("if (a &&", "MOVF BTFSC GOTO MOVF BTFSC GOTO"),
    ("return;", "GOTO"), ("goto end;", "GOTO"), ("n = b", "MOVF ADDWF MOVWF"), ("__delay_us(1);", "NOP"),
    ("NOP();", "NOP"),
    # the end of the function belongs to no statement
    (None, "RETURN"),
]  # fmt: skip


def test_the_lines_of_the_instructions() -> None:
    made = compile_sources([Source(PROGRAM, "main.c")], Options(dialect="xc8", optimise="none"))
    each = next(each for each in made.listing.functions if each.name == "f")
    lines = PROGRAM.splitlines()
    found = [
        (lines[number - 1].strip() if number else None, " ".join(row.assembly.split()[0] for row in rows))
        for number, rows in groupby(made.listing.rows[each.start : each.end], key=lambda row: row.line)
    ]
    assert found == EXPECTED
