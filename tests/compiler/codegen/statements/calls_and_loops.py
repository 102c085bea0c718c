"""Calls, statements and loops that count."""

from tests.compiler.codegen.forms import table

SHORTEST = table("""
act();
    GOTO act
a = get(b);
    MOVF b,W; CALL get; MOVWF a
a = get(5);
    MOVLW 5; CALL get; MOVWF a
a = get(a + 1);
    INCF a,W; CALL get; MOVWF a
a = get(get(a));
    MOVF a,W; CALL get; CALL get; MOVWF a
u = both(a, b);
    MOVF a,W; MOVWF t1; MOVF b,W; CALL both; MOVF t1,W; MOVWF u; MOVF t2,W; MOVWF u+1
u = both(1, 2);
    MOVLW 1; MOVWF t1; MOVLW 2; CALL both; MOVF t1,W; MOVWF u; MOVF t2,W; MOVWF u+1
u = both(get(a), b);
    MOVF a,W; CALL get; MOVWF t1; MOVF b,W; CALL both; MOVF t1,W; MOVWF u; MOVF t2,W; MOVWF u+1
a = get(b) + get(c);
    MOVF b,W; CALL get; MOVWF t1; MOVF c,W; CALL get; ADDWF t1,W; MOVWF a
a = get(b) + c;
    MOVF b,W; CALL get; ADDWF c,W; MOVWF a
a = c - get(b);
    MOVF c,W; MOVWF t1; MOVF b,W; CALL get; SUBWF t1,W; MOVWF a
if (a) act();
    MOVF a,W; BTFSS Z; GOTO act
act(); act();
    CALL act; GOTO act
a = get(b); act();
    MOVF b,W; CALL get; MOVWF a; GOTO act
a = b * c;
    MOVF b,W; MOVWF t1; MOVF c,W; MOVWF t2; CALL __mul_1_1_1; MOVF t3,W; MOVWF a
u = a * b;
    MOVF a,W; MOVWF t1; MOVF b,W; CALL __mul_1_1_2; MOVF t2,W; MOVWF u; MOVF t3,W; MOVWF u+1
a = b / c;
    MOVF b,W; MOVWF t1; MOVF c,W; MOVWF t2; CALL __divide_1_1_1; MOVF t1,W; MOVWF a
a = b % c;
    MOVF b,W; MOVWF t1; MOVF c,W; MOVWF t2; CALL __divide_1_1_1; MOVF t3,W; MOVWF a
NOP();
    NOP
CLRWDT();
    CLRWDT
SLEEP();
    SLEEP
return;
    nothing
if (a) return; n++;
    MOVF a,W; BTFSC Z; INCF n,F
if (a) { n++; return; } b++;
    MOVF a,W; BTFSC Z; GOTO $+3; INCF n,F; RETURN; INCF b,F
switch (a) { case 0: n++; break; case 5: b++; }
    MOVF a,W; BTFSC Z; GOTO $+5; XORLW 5; BTFSC Z; GOTO $+4; RETURN; INCF n,F; RETURN; INCF b,F
switch (a) { case 1: case 2: n++; }
    MOVF a,W; XORLW 1; BTFSC Z; GOTO $+4; XORLW 3; BTFSS Z; RETURN; INCF n,F
switch (s) { case -1: n++; break; case 1: b++; }
    COMF s,W; BTFSC Z; GOTO $+5; XORLW 254; BTFSC Z; GOTO $+4; RETURN; INCF n,F; RETURN; INCF b,F
goto x; n++; x: b++;
    INCF b,F
{ unsigned char z = a; n += z; PORTB = z; }
    MOVF a,W; ADDWF n,F; MOVWF PORTB
{ unsigned char z; for (z = 8; z; z--) PORTB = 1; }
    MOVLW 8; MOVWF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3
{ unsigned char z; for (z = 0; z < 20; z++) PORTB = 1; }
    MOVLW 20; MOVWF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3
{ unsigned char z; for (z = 0; z < 8; z++) PORTB = z; }
    CLRF t1; MOVF t1,W; MOVWF PORTB; INCF t1,F; BTFSS t1,3; GOTO $-4
{ unsigned char z; for (z = 0; z < 10; z++) PORTB = z; }
    CLRF t1; MOVF t1,W; MOVWF PORTB; INCF t1,F; MOVLW 10; SUBWF t1,W; BTFSS C; GOTO $-6
{ unsigned char z; for (z = 1; z <= 10; z++) PORTB = 1; }
    MOVLW 10; MOVWF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3
{ unsigned char z; for (z = 3; z != 10; z++) PORTB = 1; }
    MOVLW 7; MOVWF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3
{ int z; for (z = 0; z < 20; z++) PORTB = 1; }
    MOVLW 20; MOVWF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3
{ int z; for (z = 0; z < 20; z++) PORTB = z; }
    CLRF t1; MOVF t1,W; MOVWF PORTB; INCF t1,F; MOVLW 20; SUBWF t1,W; BTFSS C; GOTO $-6
{ int z; for (z = 0; z < 300; z++) PORTB = 1; }
    MOVLW 2; MOVWF t1; MOVLW 44; MOVWF t2; MOVLW 1; MOVWF PORTB; DECFSZ t2,F; GOTO $-3; DECFSZ t1,F; GOTO $-5
{ int z; for (z = 0; z < 256; z++) PORTB = 1; }
    CLRF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3
{ unsigned char z = 10; do PORTB = 1; while (--z); }
    MOVLW 10; MOVWF t1; MOVLW 1; MOVWF PORTB; DECFSZ t1,F; GOTO $-3
if (a) n++; else b++;
    MOVF a,W; BTFSC Z; GOTO $+3; INCF n,F; RETURN; INCF b,F
if (a < b) { n++; b++; } else c++;
    MOVF b,W; SUBWF a,W; BTFSC C; GOTO $+4; INCF n,F; INCF b,F; RETURN; INCF c,F
if (a) if (b) n++;
    MOVF a,W; BTFSC Z; RETURN; MOVF b,W; BTFSS Z; INCF n,F
""")
MOST_WORDS = {
    "u = both(a, get(b));": 13,
    "u = v / 10;": 11,
    "switch (a) { case 1: n++; break; case 2: b++; break; default: c++; }": 13,
    "switch (u) { case 1: n++; break; case 300: b++; }": 17,
    "{ unsigned int z; for (z = 0; z < 300; z++) PORTB = z; }": 15,
    "{ unsigned char z; for (z = 0; z < n; z++) PORTB = 1; }": 9,
    "{ unsigned char z = 10; while (z--) PORTB = 1; }": 9,
    "if (a) n = 1; else n = 2;": 8,
}
AS_GENERATED = 417
