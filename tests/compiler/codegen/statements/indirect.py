"""Memory behind an index or a pointer, and tables in flash."""

from tests.compiler.codegen.forms import table

SHORTEST = table("""
a = array[b];
    MOVF b,W; ADDLW array; MOVWF FSR; MOVF INDF,W; MOVWF a
l = array[a];
    MOVF a,W; ADDLW array; MOVWF FSR; MOVF INDF,W; MOVWF l; CLRF l+1; CLRF l+2; CLRF l+3
a = array[3];
    MOVF array+3,W; MOVWF a
array[b] = a;
    MOVF b,W; ADDLW array; MOVWF FSR; MOVF a,W; MOVWF INDF
array[3] = a;
    MOVF a,W; MOVWF array+3
array[b] = 0;
    MOVF b,W; ADDLW array; MOVWF FSR; CLRF INDF
array[b] = 5;
    MOVF b,W; ADDLW array; MOVWF FSR; MOVLW 5; MOVWF INDF
array[b]++;
    MOVF b,W; ADDLW array; MOVWF FSR; INCF INDF,F
array[b] += 3;
    MOVF b,W; ADDLW array; MOVWF FSR; MOVLW 3; ADDWF INDF,F
array[b] ^= a;
    MOVF b,W; ADDLW array; MOVWF FSR; MOVF a,W; XORWF INDF,F
array[b] -= 1;
    MOVF b,W; ADDLW array; MOVWF FSR; DECF INDF,F
a = *p;
    MOVF p,W; MOVWF FSR; MOVF INDF,W; MOVWF a
l = *p;
    MOVF p,W; MOVWF FSR; MOVF INDF,W; MOVWF l; CLRF l+1; CLRF l+2; CLRF l+3
*p = a;
    MOVF p,W; MOVWF FSR; MOVF a,W; MOVWF INDF
*p = 0;
    MOVF p,W; MOVWF FSR; CLRF INDF
(*p)++;
    MOVF p,W; MOVWF FSR; INCF INDF,F
*p++ = a;
    MOVF p,W; INCF p,F; MOVWF FSR; MOVF a,W; MOVWF INDF
a = *p++;
    MOVF p,W; INCF p,F; MOVWF FSR; MOVF INDF,W; MOVWF a
a = *++p;
    INCF p,F; MOVF p,W; MOVWF FSR; MOVF INDF,W; MOVWF a
*p |= 8;
    MOVF p,W; MOVWF FSR; MOVLW 8; IORWF INDF,F
p = array;
    MOVLW array; MOVWF p
p = &array[2];
    MOVLW array+2; MOVWF p
p = &array[a];
    MOVLW array; ADDWF a,W; MOVWF p
p++;
    INCF p,F
p += a;
    MOVF a,W; ADDWF p,F
a = q->first;
    MOVF q,W; MOVWF FSR; MOVF INDF,W; MOVWF a
a = q->second;
    INCF q,W; MOVWF FSR; MOVF INDF,W; MOVWF a
q->first = a;
    MOVF q,W; MOVWF FSR; MOVF a,W; MOVWF INDF
q->second = a;
    INCF q,W; MOVWF FSR; MOVF a,W; MOVWF INDF
q->second += 2;
    INCF q,W; MOVWF FSR; MOVLW 2; ADDWF INDF,F
a = p - array;
    MOVLW array; SUBWF p,W; MOVWF a
a = table[b];
    MOVF b,W; CALL __table.table; MOVWF a
l = table[a];
    MOVF a,W; CALL __table.table; MOVWF l; CLRF l+1; CLRF l+2; CLRF l+3
a = table[2];
    MOVLW 4; MOVWF a
a = table[b + 1];
    INCF b,W; CALL __table.table; MOVWF a
u = wide[b];
    BCF C; RLF b,W; MOVWF t1; CALL __table.wide; MOVWF u; INCF t1,W; CALL __table.wide; MOVWF u+1
u = wide[1];
    CLRF u+1; MOVLW 1; MOVWF u
a = array[b + 1];
    INCF b,W; ADDLW array; MOVWF FSR; MOVF INDF,W; MOVWF a
a = array[b & 7];
    MOVLW 7; ANDWF b,W; ADDLW array; MOVWF FSR; MOVF INDF,W; MOVWF a
array[a + b] = c;
    MOVF a,W; ADDWF b,W; ADDLW array; MOVWF FSR; MOVF c,W; MOVWF INDF
a = *(p + 1);
    INCF p,W; MOVWF FSR; MOVF INDF,W; MOVWF a
a = p[b];
    MOVF p,W; ADDWF b,W; MOVWF FSR; MOVF INDF,W; MOVWF a
""")
MOST_WORDS = {
    "array[a] = array[b];": 10,
}
AS_GENERATED = 207
