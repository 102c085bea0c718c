"""Conditions on bits, conversions, and values of which only being 0 matters."""

from tests.compiler.codegen.forms import table

SHORTEST = table("""
if ((__bit)a) n++;
    BTFSC a,0; INCF n,F
if (!(__bit)a) n++;
    BTFSS a,0; INCF n,F
n = (_Bool)u;
    CLRF n; MOVF u,W; IORWF u+1,W; BTFSS Z; INCF n,F
n = (_Bool)a;
    CLRF n; MOVF a,W; BTFSS Z; INCF n,F
if ((_Bool)u) n++;
    MOVF u,W; IORWF u+1,W; BTFSS Z; INCF n,F
if (f.lo) n++;
    MOVF f,W; ANDLW 7; BTFSS Z; INCF n,F
if (q->first == 3) n++;
    MOVF q,W; MOVWF FSR; MOVF INDF,W; XORLW 3; BTFSC Z; INCF n,F
if (a == 5 || b == 6) n++; else c++;
    MOVF a,W; XORLW 5; BTFSC Z; GOTO $+5; MOVF b,W; XORLW 6; BTFSS Z; GOTO $+3; INCF n,F; RETURN; INCF c,F
if (!(a < b)) n++;
    MOVF b,W; SUBWF a,W; BTFSC C; INCF n,F
if (!(u == 3)) n++;
    MOVF u,W; XORLW 3; IORWF u+1,W; BTFSS Z; INCF n,F
if (a ^ 3) n++;
    MOVLW 3; XORWF a,W; BTFSS Z; INCF n,F
if (a % 4) n++;
    MOVF a,W; ANDLW 3; BTFSS Z; INCF n,F
if (!(a % 4)) n++;
    MOVF a,W; ANDLW 3; BTFSC Z; INCF n,F
if (u >> 8) n++;
    MOVF u+1,W; BTFSS Z; INCF n,F
if (u & 0xFF00) n++;
    MOVF u+1,W; BTFSS Z; INCF n,F
if ((a & b) == 0) n++;
    MOVF a,W; ANDWF b,W; BTFSC Z; INCF n,F
if (p != 0) n++;
    MOVF p,W; BTFSS Z; INCF n,F
if (k & 4) n++;
    BTFSC k,2; INCF n,F
if (PORTB & 0x80) n++;
    BTFSC PORTB,7; INCF n,F
""")
MOST_WORDS = {
    "if (TRISB0) n++;": 6,
    "flag = (__bit)a;": 4,
    "if ((__bit)TRISA) n++;": 6,
    "if (~a) n++;": 7,
    "if (-a) n++;": 12,
    "if (a - b) n++;": 9,
    "if (s - 3) n++;": 12,
    "if (u & 0x0101) n++;": 8,
    "if (--u) n++;": 8,
    "if (RB7 == 1) n++;": 6,
    "if (RB7 != 1) n++;": 6,
    "if (flag == other) n++;": 9,
    "if (a == 1 ? b : c) n++;": 11,
}
AS_GENERATED = 248
