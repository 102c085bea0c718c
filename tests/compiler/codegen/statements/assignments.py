"""Assignments and the operators that they compute."""

from tests.compiler.codegen.forms import table

SHORTEST = table("""
a = b;
    MOVF b,W; MOVWF a
a = 5;
    MOVLW 5; MOVWF a
a = 0;
    CLRF a
a = a;
    nothing
k = k;
    MOVF k,W; MOVWF k
u = v;
    MOVF v,W; MOVWF u; MOVF v+1,W; MOVWF u+1
u = 5;
    CLRF u+1; MOVLW 5; MOVWF u
u = 0x1234;
    MOVLW 18; MOVWF u+1; MOVLW 52; MOVWF u
u = a;
    MOVF a,W; MOVWF u; CLRF u+1
l = a;
    MOVF a,W; MOVWF l; CLRF l+1; CLRF l+2; CLRF l+3
l = a + b;
    MOVF b,W; ADDWF a,W; MOVWF l; CLRF l+1; RLF l+1,F; CLRF l+2; CLRF l+3
i = a >> 1;
    BCF C; RRF a,W; MOVWF i; CLRF i+1
u = f.lo;
    MOVF f,W; ANDLW 7; MOVWF u; CLRF u+1
a = u;
    MOVF u,W; MOVWF a
a = u >> 8;
    MOVF u+1,W; MOVWF a
a = b = c;
    MOVF c,W; MOVWF b; MOVWF a
a++;
    INCF a,F
a--;
    DECF a,F
++a;
    INCF a,F
a += 1;
    INCF a,F
a -= 1;
    DECF a,F
a += 2;
    MOVLW 2; ADDWF a,F
a -= 2;
    MOVLW 254; ADDWF a,F
a += b;
    MOVF b,W; ADDWF a,F
a -= b;
    MOVF b,W; SUBWF a,F
a &= b;
    MOVF b,W; ANDWF a,F
a |= 8;
    BSF a,3
a &= ~8;
    BCF a,3
a |= 9;
    MOVLW 9; IORWF a,F
a ^= 8;
    MOVLW 8; XORWF a,F
a ^= 0xFF;
    COMF a,F
a = ~a;
    COMF a,F
a = -a;
    COMF a,F; INCF a,F
a = a + 1;
    INCF a,F
a = b + 1;
    INCF b,W; MOVWF a
a = b - 1;
    DECF b,W; MOVWF a
a = 1 - b;
    MOVF b,W; SUBLW 1; MOVWF a
a = b + c;
    MOVF b,W; ADDWF c,W; MOVWF a
a = b - c;
    MOVF c,W; SUBWF b,W; MOVWF a
a = c - a;
    MOVF a,W; SUBWF c,W; MOVWF a
a = b + c + 1;
    INCF c,W; ADDWF b,W; MOVWF a
a = (b ^ c) & 7;
    MOVF b,W; XORWF c,W; ANDLW 7; MOVWF a
a = b + (c & 3);
    MOVLW 3; ANDWF c,W; ADDWF b,W; MOVWF a
a = ~b;
    COMF b,W; MOVWF a
a = -b;
    MOVF b,W; SUBLW 0; MOVWF a
a <<= 1;
    BCF C; RLF a,F
a >>= 1;
    BCF C; RRF a,F
a <<= 4;
    SWAPF a,W; ANDLW 240; MOVWF a
a = b << 1;
    BCF C; RLF b,W; MOVWF a
a = b >> 7;
    RLF b,W; CLRF a; RLF a,F
s >>= 1;
    RLF s,W; RRF s,F
u++;
    INCF u,F; BTFSC Z; INCF u+1,F
u--;
    MOVF u,F; BTFSC Z; DECF u+1,F; DECF u,F
u += a;
    MOVF a,W; ADDWF u,F; BTFSC C; INCF u+1,F
u += v;
    MOVF v,W; ADDWF u,F; MOVF v+1,W; BTFSC C; INCFSZ v+1,W; ADDWF u+1,F
u = v + u;
    MOVF v,W; ADDWF u,F; MOVF v+1,W; BTFSC C; INCFSZ v+1,W; ADDWF u+1,F
u = v ^ u;
    MOVF v,W; XORWF u,F; MOVF v+1,W; XORWF u+1,F
u = u + 256;
    INCF u+1,F
u -= 256;
    DECF u+1,F
v = u + 256;
    MOVF u,W; MOVWF v; INCF u+1,W; MOVWF v+1
u += 0x34;
    MOVLW 52; ADDWF u,F; BTFSC C; INCF u+1,F
u += 0xFF34;
    MOVLW 52; ADDWF u,F; BTFSS C; DECF u+1,F
u += 0x1234;
    MOVLW 52; ADDWF u,F; MOVLW 18; BTFSC C; MOVLW 19; ADDWF u+1,F
l -= 256;
    MOVLW 1; SUBWF l+1,F; BTFSS C; SUBWF l+2,F; BTFSS C; DECF l+3,F
u <<= 1;
    BCF C; RLF u,F; RLF u+1,F
u >>= 1;
    BCF C; RRF u+1,F; RRF u,F
u = v << 8;
    MOVF v,W; MOVWF u+1; CLRF u
u = a << 8;
    MOVF a,W; MOVWF u+1; CLRF u
u = a << 8 | b;
    MOVF b,W; MOVWF u; MOVF a,W; MOVWF u+1
u = ~u;
    COMF u,F; COMF u+1,F
u = -u;
    COMF u,F; COMF u+1,F; INCF u,F; BTFSC Z; INCF u+1,F
u |= 0x100;
    BSF u+1,0
u &= 0xFF;
    CLRF u+1
l++;
    INCF l,F; BTFSC Z; INCF l+1,F; BTFSC Z; INCF l+2,F; BTFSC Z; INCF l+3,F
a *= 2;
    BCF C; RLF a,F
a = b * 3;
    MOVF b,W; ADDWF b,W; ADDWF b,W; MOVWF a
a = b % 8;
    MOVF b,W; ANDLW 7; MOVWF a
u = v / 256;
    MOVF v+1,W; MOVWF u; CLRF u+1
u = v % 16;
    MOVF v,W; ANDLW 15; MOVWF u; CLRF u+1
a = !b;
    CLRF a; MOVF b,W; BTFSC Z; INCF a,F
a = !!b;
    CLRF a; MOVF b,W; BTFSS Z; INCF a,F
a = b == c;
    CLRF a; MOVF b,W; XORWF c,W; BTFSC Z; INCF a,F
a = b < c;
    CLRF a; MOVF c,W; SUBWF b,W; BTFSS C; INCF a,F
flag = 1;
    BSF flag,0
flag = 0;
    BCF flag,0
flag = !flag;
    MOVLW 1; XORWF flag,F
flag ^= 1;
    MOVLW 1; XORWF flag,F
RB0 = flag;
    BTFSC flag,0; BSF PORTB,0; BTFSS flag,0; BCF PORTB,0
RB0 = 1;
    BSF PORTB,0
RB0 = !RB0;
    MOVLW 1; XORWF PORTB,F
flag = a == b;
    MOVF a,W; XORWF b,W; BTFSS Z; BCF flag,0; BTFSC Z; BSF flag,0
f.one = 1;
    BSF f,3
f.lo = 5;
    MOVF f,W; ANDLW 248; IORLW 5; MOVWF f
f.lo = a;
    MOVF a,W; ANDLW 7; IORWF f,F; IORLW 248; ANDWF f,F
a = f.lo;
    MOVF f,W; ANDLW 7; MOVWF a
a = f.one;
    CLRF a; BTFSC f,3; INCF a,F
TRISB = 0;
    BSF RP0; CLRF TRISB; BCF RP0
TRISB = a;
    MOVF a,W; BSF RP0; MOVWF TRISB; BCF RP0
a = TRISB;
    BSF RP0; MOVF TRISB,W; BCF RP0; MOVWF a
TRISB0 = 1;
    BSF RP0; BSF TRISB,0; BCF RP0
PORTB = a + b;
    MOVF a,W; ADDWF b,W; MOVWF PORTB
PORTB ^= 8;
    MOVLW 8; XORWF PORTB,F
r.first = r.second;
    MOVF r+1,W; MOVWF r
r = *q;
    MOVF q,W; MOVWF FSR; MOVF INDF,W; MOVWF r; INCF FSR,F; MOVF INDF,W; MOVWF r+1
*q = r;
    MOVF q,W; MOVWF FSR; MOVF r,W; MOVWF INDF; INCF FSR,F; MOVF r+1,W; MOVWF INDF
k++;
    INCF k,F
a = (b, c);
    MOVF c,W; MOVWF a
a = (signed char)b >> 1;
    RLF b,W; RRF b,W; MOVWF a
""")
MOST_WORDS = {
    "flag = a;": 4,
    "flag = other;": 4,
    "i = s;": 7,
    "u = s;": 7,
    "l = s;": 9,
    "a = b << c;": 13,
    "u -= a;": 6,
    "u = v + 1;": 7,
    "l += v;": 11,
    "a = b * 8;": 6,
    "a = b / 4;": 5,
    "s = t / 2;": 13,
    "a = b ? c : 4;": 8,
    "a = b ? 7 : 3;": 8,
    "a = b && c;": 7,
    "a = b || c;": 8,
    "flag = RB0;": 5,
    "RB1 = RB0;": 5,
    "a = f.hi;": 6,
    "f.hi++;": 11,
    "k |= 0;": 2,
}
AS_GENERATED = 530
