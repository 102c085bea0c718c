"""Conditions and the jumps that they become."""

from tests.compiler.codegen.forms import table

SHORTEST = table("""
if (a == b) n++;
    MOVF a,W; XORWF b,W; BTFSC Z; INCF n,F
if (a != b) n++;
    MOVF a,W; XORWF b,W; BTFSS Z; INCF n,F
if (a < b) n++;
    MOVF b,W; SUBWF a,W; BTFSS C; INCF n,F
if (a <= b) n++;
    MOVF a,W; SUBWF b,W; BTFSC C; INCF n,F
if (a > b) n++;
    MOVF a,W; SUBWF b,W; BTFSS C; INCF n,F
if (a >= b) n++;
    MOVF b,W; SUBWF a,W; BTFSC C; INCF n,F
if (a == 5) n++;
    MOVF a,W; XORLW 5; BTFSC Z; INCF n,F
if (5 != a) n++;
    MOVF a,W; XORLW 5; BTFSS Z; INCF n,F
if (a == 0) n++;
    MOVF a,W; BTFSC Z; INCF n,F
if (a == 255) n++;
    COMF a,W; BTFSC Z; INCF n,F
if (a < 5) n++;
    MOVLW 5; SUBWF a,W; BTFSS C; INCF n,F
if (a <= 5) n++;
    MOVLW 6; SUBWF a,W; BTFSS C; INCF n,F
if (a > 5) n++;
    MOVLW 6; SUBWF a,W; BTFSC C; INCF n,F
if (a >= 5) n++;
    MOVLW 5; SUBWF a,W; BTFSC C; INCF n,F
if (5 < a) n++;
    MOVLW 6; SUBWF a,W; BTFSC C; INCF n,F
if (5 >= a) n++;
    MOVLW 6; SUBWF a,W; BTFSS C; INCF n,F
if (a < 1) n++;
    MOVF a,W; BTFSC Z; INCF n,F
if (a >= 1) n++;
    MOVF a,W; BTFSS Z; INCF n,F
if (a > 254) n++;
    INCF a,W; BTFSC Z; INCF n,F
if (a < 255) n++;
    INCF a,W; BTFSS Z; INCF n,F
if (a >= 128) n++;
    BTFSC a,7; INCF n,F
if (a < 128) n++;
    BTFSS a,7; INCF n,F
if (a < 256) n++;
    INCF n,F
if (a > 255) n++;
    nothing
if (a >= 0) n++;
    INCF n,F
if (a == 256) n++;
    nothing
if (a != 256) n++;
    INCF n,F
if ((unsigned char)(a + b) < 5) n++;
    MOVF a,W; ADDWF b,W; ADDLW 251; BTFSS C; INCF n,F
if ((unsigned char)(a + b) == 5) n++;
    MOVF a,W; ADDWF b,W; XORLW 5; BTFSC Z; INCF n,F
if (s < 0) n++;
    BTFSC s,7; INCF n,F
if (s >= 0) n++;
    BTFSS s,7; INCF n,F
if (s > -1) n++;
    BTFSS s,7; INCF n,F
if (s < 5) n++;
    MOVF s,W; XORLW 128; ADDLW 123; BTFSS C; INCF n,F
if (s >= -3) n++;
    MOVF s,W; XORLW 128; ADDLW 131; BTFSC C; INCF n,F
if (s > 127) n++;
    nothing
if (s <= -128) n++;
    MOVF s,W; XORLW 128; ADDLW 255; BTFSS C; INCF n,F
if (s == -1) n++;
    COMF s,W; BTFSC Z; INCF n,F
if (u == v) n++;
    MOVF v,W; XORWF u,W; BTFSS Z; RETURN; MOVF v+1,W; XORWF u+1,W; BTFSC Z; INCF n,F
if (u != v) n++;
    MOVF v,W; XORWF u,W; BTFSS Z; GOTO $+5; MOVF v+1,W; XORWF u+1,W; BTFSC Z; RETURN; INCF n,F
if (u < v) n++;
    MOVF v,W; SUBWF u,W; MOVF v+1,W; BTFSS C; INCFSZ v+1,W; SUBWF u+1,W; BTFSS C; INCF n,F
if (u == 0) n++;
    MOVF u,W; IORWF u+1,W; BTFSC Z; INCF n,F
if (u == 7) n++;
    MOVF u,W; XORLW 7; IORWF u+1,W; BTFSC Z; INCF n,F
if (u == 0x700) n++;
    MOVF u+1,W; XORLW 7; IORWF u,W; BTFSC Z; INCF n,F
if (u == 0x1234) n++;
    MOVF u,W; XORLW 52; BTFSS Z; RETURN; MOVF u+1,W; XORLW 18; BTFSC Z; INCF n,F
if (u < 0x1234) n++;
    MOVLW 52; SUBWF u,W; MOVLW 18; BTFSS C; MOVLW 19; SUBWF u+1,W; BTFSS C; INCF n,F
if (u > 0x12FF) n++;
    MOVLW 19; SUBWF u+1,W; BTFSC C; INCF n,F
if (u >= 0xFF34) n++;
    MOVLW 52; SUBWF u,W; MOVLW 255; BTFSC C; SUBWF u+1,W; BTFSC C; INCF n,F
if (i < 0) n++;
    BTFSC i+1,7; INCF n,F
if (l) n++;
    MOVF l,W; IORWF l+1,W; IORWF l+2,W; IORWF l+3,W; BTFSS Z; INCF n,F
if (!l) n++;
    MOVF l,W; IORWF l+1,W; IORWF l+2,W; IORWF l+3,W; BTFSC Z; INCF n,F
if (l == 0x10000) n++;
    MOVF l+2,W; XORLW 1; IORWF l,W; IORWF l+1,W; IORWF l+3,W; BTFSC Z; INCF n,F
if (a) n++;
    MOVF a,W; BTFSS Z; INCF n,F
if (!a) n++;
    MOVF a,W; BTFSC Z; INCF n,F
if (a & 8) n++;
    BTFSC a,3; INCF n,F
if (!(a & 8)) n++;
    BTFSS a,3; INCF n,F
if (8 & a) n++;
    BTFSC a,3; INCF n,F
if (u & 0x400) n++;
    BTFSC u+1,2; INCF n,F
if (a & 6) n++;
    MOVLW 6; ANDWF a,W; BTFSS Z; INCF n,F
if (u & 0x1000 && u & 1) n++;
    BTFSS u+1,4; RETURN; BTFSC u,0; INCF n,F
if (a && b) n++;
    MOVF a,W; BTFSC Z; RETURN; MOVF b,W; BTFSS Z; INCF n,F
if (a || b) n++;
    MOVF a,W; BTFSS Z; GOTO $+4; MOVF b,W; BTFSC Z; RETURN; INCF n,F
if (!(a && b)) n++;
    MOVF a,W; BTFSC Z; GOTO $+4; MOVF b,W; BTFSS Z; RETURN; INCF n,F
if (flag) n++;
    BTFSC flag,0; INCF n,F
if (!flag) n++;
    BTFSS flag,0; INCF n,F
if (flag && RB3) n++;
    BTFSS flag,0; RETURN; BTFSC PORTB,3; INCF n,F
if (TRISB == 1) n++;
    BSF RP0; MOVF TRISB,W; BCF RP0; XORLW 1; BTFSC Z; INCF n,F
if (f.one) n++;
    BTFSC f,3; INCF n,F
if ((a & 0x81) == 0x81) n++;
    COMF a,W; ANDLW 129; BTFSC Z; INCF n,F
if (a == (b ^ 3)) n++;
    MOVLW 3; XORWF b,W; XORWF a,W; BTFSC Z; INCF n,F
if (--a) n++;
    DECF a,F; BTFSS Z; INCF n,F
if (!--a) n++;
    DECFSZ a,F; RETURN; INCF n,F
if (++a) n++;
    INCF a,F; BTFSS Z; INCF n,F
if (a--) n++;
    DECF a,F; INCF a,W; BTFSS Z; INCF n,F
if (!a--) n++;
    DECF a,F; INCFSZ a,W; RETURN; INCF n,F
if ((a = b)) n++;
    MOVF b,W; MOVWF a; BTFSS Z; INCF n,F
if (get(a)) n++;
    MOVF a,W; CALL get; IORLW 0; BTFSS Z; INCF n,F
if (get(a) == 3) n++;
    MOVF a,W; CALL get; XORLW 3; BTFSC Z; INCF n,F
if (get(a) == b) n++;
    MOVF a,W; CALL get; XORWF b,W; BTFSC Z; INCF n,F
if (array[a]) n++;
    MOVF a,W; ADDLW array; MOVWF FSR; MOVF INDF,W; BTFSS Z; INCF n,F
if (array[a] & 4) n++;
    MOVF a,W; ADDLW array; MOVWF FSR; MOVF INDF,W; ANDLW 4; BTFSS Z; INCF n,F
if (*p) n++;
    MOVF p,W; MOVWF FSR; MOVF INDF,W; BTFSS Z; INCF n,F
if (q->second) n++;
    INCF q,W; MOVWF FSR; MOVF INDF,W; BTFSS Z; INCF n,F
if ((unsigned char)u) n++;
    MOVF u,W; BTFSS Z; INCF n,F
if (a == b && b == c) n++;
    MOVF a,W; XORWF b,W; BTFSS Z; RETURN; MOVF b,W; XORWF c,W; BTFSC Z; INCF n,F
if (a < 5 || a > 9) n++;
    MOVLW 5; SUBWF a,W; BTFSS C; GOTO $+5; MOVLW 10; SUBWF a,W; BTFSS C; RETURN; INCF n,F
if (k) n++;
    MOVF k,W; BTFSS Z; INCF n,F
if (k == k) n++;
    MOVF k,W; XORWF k,W; BTFSC Z; INCF n,F
if (PORTB == 3) n++;
    MOVF PORTB,W; XORLW 3; BTFSC Z; INCF n,F
if (PORTB & 3) n++;
    MOVLW 3; ANDWF PORTB,W; BTFSS Z; INCF n,F
if (p) n++;
    MOVF p,W; BTFSS Z; INCF n,F
if (p == array) n++;
    MOVLW array; XORWF p,W; BTFSC Z; INCF n,F
if ((a, b)) n++;
    MOVF b,W; BTFSS Z; INCF n,F
if (table[a] == 3) n++;
    MOVF a,W; CALL __table.table; XORLW 3; BTFSC Z; INCF n,F
if ((char)(a & 0x0F) > 3) n++;
    MOVLW 15; ANDWF a,W; ADDLW 252; BTFSC C; INCF n,F
while (a) a--;
    MOVF a,W; BTFSC Z; RETURN; DECF a,F; GOTO $-4
do n++; while (--a);
    INCF n,F; DECFSZ a,F; GOTO $-2
do n++; while (a != b);
    INCF n,F; MOVF a,W; XORWF b,W; BTFSS Z; GOTO $-4
for (;;) if (a) break;
    MOVF a,W; BTFSS Z; RETURN; GOTO $-3
while (1) { if (a) continue; if (b) break; n++; }
    MOVF a,W; BTFSS Z; GOTO $-2; MOVF b,W; BTFSS Z; RETURN; INCF n,F; GOTO $-7
for (a = 0; a < 8; a++) n++;
    CLRF a; INCF n,F; INCF a,F; MOVLW 8; SUBWF a,W; BTFSS C; GOTO $-5
for (a = 0; a < 10; a++) PORTB = a;
    CLRF a; MOVF a,W; MOVWF PORTB; INCF a,F; MOVLW 10; SUBWF a,W; BTFSS C; GOTO $-6
""")
MOST_WORDS = {
    "if (TRISB & 1) n++;": 6,
    "if (s < t) n++;": 8,
    "if (a + b < 5) n++;": 12,
    "if (i < j) n++;": 14,
    "if (i < 300) n++;": 11,
    "if (i >= -300) n++;": 11,
    "if (f.hi == 3) n++;": 6,
    "if (a++) n++;": 6,
    "if ((a += b)) n++;": 5,
    "if (a ? b : c) n++;": 11,
    "if (a * 2 > 5) n++;": 11,
    "if (table[a]) n++;": 5,
    "if ((flag = a)) n++;": 10,
    "while (--a);": 4,
}
AS_GENERATED = 666
