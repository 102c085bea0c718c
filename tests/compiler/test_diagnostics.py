"""The text and the place of errors and warnings: ‸ stands where the caret is to be."""

from __future__ import annotations

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.errors import Diagnostic, InputError

CARET = "‸"


def reported(dialect: str, text: str) -> Compilation | InputError:
    try:
        return compile_sources([Source(text, "main.c")], Options(dialect=dialect))
    except InputError as error:
        return error


def diagnostics(dialect: str, text: str) -> tuple[Diagnostic, ...]:
    return reported(dialect, text).diagnostics


SERIAL = "#pragma CLOCK_FREQ 4000000\n#pragma RS232_TXPORT PORTB\n"
ROWS = [
    ("xc8", "int ‸a[2][50463240] = {1};\nvoid main(void) { }", "error",
        "an array of 100926480 bytes is larger than the chip's memory"),
    ("xc8", "char ‸a[] = {[9999999] = 1};\nvoid main(void) { }", "error",
        "an array of 10000000 bytes is larger than the chip's memory"),
    ("xc8", "‸#define _XTAL_FREQ fast\nvoid main(void) { }", "error",
        "_XTAL_FREQ must be a frequency in hertz, not 'fast'"),
    ("xc8", "int x;\nvoid main(void) { ‸x <<= 16; }", "warning", "shift by 16, but 'int' has only 16 bits"),
    ("xc8", "struct { int a; } s, *p;\nstruct { char b; } t;\nvoid main(void) { ‸p ? s : t; }", "error",
        "the two values of '?:' have the types 'struct (unnamed 1)' and 'struct (unnamed 2)'"),
    ("c2c", "bit ‸b[3];\nvoid main(void) {  }", "error", "there are no arrays of bits"),
    ("xc8", "struct p { unsigned char a; } f(void); unsigned char x = ‸f().a;void main(void) {  }", "error",
        "a function cannot be called outside functions"),
    ("xc8", "struct { int a; } s;void main(void) { ‸s.0 = 1; }", "error",
        "only an integer variable has bits"),
    ("xc8", "unsigned char x;void main(void) { ‸x.9 = 1; }", "error", "'unsigned char' has no bit 9"),
    ("xc8", "unsigned int x;void main(void) { ‸x.17 = 1; }", "error", "'unsigned int' has no bit 17"),
    ("xc8", "void main(void) { (‸1)(); }", "error", "'int' is not a function"),
    ("xc8", "int a[2];void main(void) { ‸a[0](); }", "error", "'int' is not a function"),
    ("xc8", "struct q ‸s;void main(void) {  }", "error", "'struct q' is not defined"),
    ("xc8", "void *p; unsigned char x;void main(void) { x = *‸p; }", "error",
        "a void pointer cannot be dereferenced; cast it first"),
    ("xc8", "void g(void) { } void (*f)(void);void main(void) { f = g; ‸f(1); }", "error",
        "the function takes 0 arguments, 1 is given"),
    ("xc8", "void __interrupt() g(void) { } void (*f)(void);void main(void) { f = ‸g; }", "error",
        "the interrupt function 'g' cannot be called"),
    ("xc8", "int f(void) { return 1; } int x;void main(void) { x = ‸f; }", "warning",
        "the assignment makes 'int' from the pointer 'int (*)()' without a cast"),
    ("xc8", "unsigned char *p;void main(void) { p = &‸5; }", "error", "this has no address"),
    ("xc8", "bit b; unsigned char *p;void main(void) { p = &‸b; }", "error", "a bit has no address"),
    ("xc8", "char a[2], b[2];void main(void) { ‸a = b; }", "error", "an array cannot be assigned to"),
    ("xc8", "int x;void main(void) { ‸x->a = 1; }", "error",
        "'->' needs a pointer to a structure, not 'int'"),
    ("xc8", "int x;void main(void) { ‸x(); }", "error", "'x' is not a function"),
    ("xc8", "int __interrupt() ‸f(void) { return 1; }void main(void) {  }", "error",
        "an interrupt function has no parameters and returns void"),
    ("xc8", "int x; char *p;void main(void) { x = ‸p; }", "warning",
        "the assignment makes 'int' from the pointer 'unsigned char *' without a cast"),
    ("xc8", "int *p; char *q;void main(void) { p = ‸q; }", "warning",
        "the assignment makes 'int *' from 'unsigned char *' without a cast"),
    ("xc8", "struct { int a; } s;void main(void) { if (‸s) ; }", "error",
        "a condition needs a number or a pointer, not 'struct (unnamed 1)'"),
    ("xc8", "char *p;void main(void) { p = ‸5; }", "warning",
        "the assignment makes a pointer from the number 5 without a cast"),
    ("xc8", "char *p; int x;void main(void) { p = ‸x; }", "warning",
        "the assignment makes a pointer from 'int' without a cast"),
    ("c2c", SERIAL + "#pragma RS232_TXPIN 9\n#pragma RS232_BAUD 9600\nvoid main(void) { ‸putchar('a'); }",
        "error", "the serial pin 6.9 does not exist"),
    ("c2c", SERIAL + "#pragma RS232_TXPIN 1\n#pragma RS232_BAUD 0\nvoid main(void) { ‸putchar('a'); }",
        "error", "the baud rate must be positive, not 0"),
    ("c2c", SERIAL + "#pragma RS232_TXPIN one\n#pragma RS232_BAUD 9600\nvoid main(void) { ‸putchar('a'); }",
        "error", "'#pragma RS232_TXPIN one': a number is needed"),
    ("xc8", "typedef int f;\nf ‸g { return 1; }\nvoid main(void) {  }", "error",
        "'g' is not a function but has a body"),
    ("xc8", "int ‸g { return 1; }void main(void) {  }", "error", "'g' is not a function but has a body"),
    ("c2c", "void main(void) { ‸set_bit(5, 1); }", "error",
        "the first argument must be a variable or a register"),
    ("xc8", "#define _XTAL_FREQ 4000000\nvoid main(void) { __delay_us(-‸1); }", "error",
        "'__delay_us' cannot take a negative time"),
    ("xc8",
        8 * "__EEPROM_DATA(1,2,3,4,5,6,7,8);\n" + "‸__EEPROM_DATA(1,2,3,4,5,6,7,8);\nvoid main(void) {  }",
        "error", "__EEPROM_DATA fills more than the 64 bytes of the EEPROM"),
    ("c2c", "‸asm movlw 5\nvoid main(void) {  }", "error", "assembly outside functions can only be __config"),
    ("c2c", "‸asm __config\nvoid main(void) {  }", "error",
        "assembly outside functions can only be __config"),
    ("xc8", "void main(void) { void ‸x; }", "error", "'x' cannot be of type void"),
    ("xc8", "char ‸x @ 0x100;void main(void) {  }", "error",
        "the address 0x100 is not in the data memory (0x00-0xFF)"),
    ("xc8", "int a = 1; int ‸a = 2;void main(void) {  }", "error", "'a' is initialised twice"),
    ("xc8", "extern const int a; int x; const int ‸b;void main(void) { x = a; }", "warning",
        "the constant 'b' has no value; it is 0"),
    ("xc8", "int x; const int ‸b;void main(void) { x = b; }", "warning",
        "the constant 'b' has no value; it is 0"),
    ("xc8", "int *p, *q, x;void main(void) { x = ‸p * q; }", "error",
        "'*' cannot be applied to 'int *' and 'int *'"),
    ("xc8", "struct { int a; } s;void main(void) { ‸s++; }", "error",
        "'++' cannot be applied to 'struct (unnamed 1)'"),
    ("xc8", "struct { int a; } s;void main(void) { ‸s += 1; }", "error",
        "'+=' cannot be applied to 'struct (unnamed 1)'"),
    ("xc8", "struct { int a; } s; int x;void main(void) { x = ‸(int)s; }", "error",
        "'struct (unnamed 1)' cannot be cast to 'int'"),
    ("xc8", "int *p;void main(void) { ‸p *= 2; }", "error", "'*=' cannot be applied to a pointer"),
    ("xc8", "int x;void main(void) { x = ‸x << 16; }", "warning", "shift by 16, but 'int' has only 16 bits"),
    ("xc8", "struct { int a; } s; int x; int *p;void main(void) { x = x ? p : ‸s; }", "error",
        "the second value needs 'int *', not 'struct (unnamed 1)'"),
    ("xc8", "int x; int y = ‸x;void main(void) {  }", "error", "the initialiser must be a constant"),
    ("xc8", "int a[2] = ‸5;void main(void) {  }", "error", "'int[2]' needs an initialiser in braces"),
    ("xc8", "struct { int a; } s = ‸5;void main(void) {  }", "error",
        "'struct (unnamed 1)' needs an initialiser in braces"),
    ("xc8", "int a[2] = {1, 2, ‸3};void main(void) {  }", "error", "too many initialisers for 'int[2]'"),
    ("xc8", "int a = {‸1, 2};void main(void) {  }", "error", "'int' takes one initialiser, 2 are given"),
    ("xc8", "struct { int a; } s = {.b = ‸1};void main(void) {  }", "error",
        "'struct (unnamed 1)' has no such member"),
    ("xc8", 'char s[2] = ‸"abc";void main(void) {  }', "error",
        "the string of 3 characters does not fit an array of 2"),
    ("xc8", "int a[2] = {[5] = ‸1};void main(void) {  }", "error", "this element does not exist"),
    ("xc8", "struct { int a[2]; } s = {.a[1] = ‸1};void main(void) {  }", "error",
        "nested designators are not supported"),
    ("c2c", "void main(void) { \n ‸asm movwx 5\n }", "error", "assembly: unknown instruction 'movwx'"),
    ("c2c", "void main(void) { \n ‸asm goto 5+x\n }", "error", "assembly: '5 + x' is not a label"),
    ("c2c", "void main(void) { \n ‸asm movwf nothing\n }", "error",
        "assembly: 'nothing' is neither a register nor a variable"),
    ("c2c", "void main(void) { \n ‸asm movwf 0x1FF\n }", "error",
        "assembly: the register address 511 is outside 0 to 0xFF"),
    ("c2c", "void main(void) { \n ‸asm bsf 5,9\n }", "error",
        "assembly: '9' is not a bit number from 0 to 7"),
    ("c2c", "void main(void) { \n ‸asm movlw 256\n }", "error",
        "assembly: the literal 256 is outside 0 to 255"),
    ("c2c", "void main(void) { \n ‸asm movlw 300-10-1\n }", "error",
        "assembly: the literal 300 - 10 - 1 is 289, outside 0 to 255"),
    ("c2c", "void main(void) { \n ‸asm movlw many\n }", "error",
        "assembly: 'many' is not a number from 0 to 255"),
    ("c2c", "const char t[2] = {1, 2};void main(void) { \n ‸asm movf _t, w\n }", "error",
        "assembly: 't' is in flash and has no RAM address"),
    ("c2c", "void main(void) { \n ‸asm movf 0x0C, x\n }", "error",
        "assembly: the destination is W or F, not 'x'"),
    ("c2c", "void main(void) { \n ‸asm movf\n }", "error", "assembly: MOVF needs 1 operand, not 0"),
    ("xc8", "int x;void main(void) { x = sizeof(int) + ‸__builtin_x; }", "error",
        "'__builtin_x' is not declared"),
    ("xc8", "int x;void main(void) { x = ‸_Generic(1, int: 2); }", "error",
        "a generic selection is not supported"),
    ("xc8", "int x; int a[‸x];void main(void) {  }", "error", "the size of an array must be a constant"),
    ("xc8", "int x;void main(void) { x = ‸99999999999; }", "error", "99999999999 does not fit in 32 bits"),
    ("xc8", "int x;void main(void) { x = ‸0x1FFFFFFFF; }", "error", "0x1FFFFFFFF does not fit in 32 bits"),
    ("xc8", "int x;void main(void) { x = ‸'\\q'; }", "warning", "unknown escape '\\q'"),
    ("xc8", "int x;void main(void) { x = ‸'€'; }", "warning",
        "the character '€' is not in Latin-1 and becomes '?'"),
    ("xc8", "void main(void) { if (1) ‸{", "error",
        "syntax error: the file ends in the middle of a declaration"),
    ("xc8", "‸#include xc.h\nvoid main(void) {  }", "error", "#include needs a file name in <…> or quotes"),
    ("xc8", "‸#include 5\nvoid main(void) {  }", "error", "#include needs a file name in <…> or quotes"),
    ("xc8", "‸#warning take care\nvoid main(void) {  }", "warning", "#warning take care"),
    ("xc8", "‸#nothing\nvoid main(void) {  }", "error", "unknown preprocessor directive #nothing"),
    ("xc8", '‸#line 7 "b.c"\nvoid main(void) {  }', "error",
        "#line is not supported: messages name the lines of the file itself"),
    ("xc8", '‸#pragma push_macro("A")\nvoid main(void) {  }', "error", "#pragma push_macro is not supported"),
    ("xc8", 'char v;\nvoid main(void) { asm("" ‸: "+r"(v)); }', "error",
        "assembly with operands is not supported: asm() takes only strings"),
    ("xc8", "‸# 5x\nvoid main(void) {  }", "error", "unknown preprocessor directive #5x"),
    ("xc8", "__eeprom char a[4]; char i;void main(void) { ‸a[i++] += 2; }", "error",
        "the address of this object would be computed twice, and computing it has a side effect"),
    ("xc8", "__eeprom struct s {int a;} e; struct s x;void main(void) { x = ‸e; }", "error",
        "an array or structure in the EEPROM cannot be copied as a whole"),
    ("xc8", "__eeprom char e; char *p;void main(void) { p = &‸e; }", "error",
        "there are no pointers into the EEPROM"),
    ("xc8", "__eeprom struct {char a : 3;} e;void main(void) { ‸e.a = 1; }", "error",
        "bit-fields cannot be kept in the EEPROM"),
    ("xc8", "__eeprom char a[60];\n__eeprom char ‸b[5];\nvoid main(void) { }", "error",
        "'b' ends at byte 65 of the EEPROM, which has 64"),
    ("xc8", "void main(void) { __eeprom char ‸a; a = 1; }", "error",
        "'a' in the EEPROM must be static or outside functions"),
    ("xc8", "void f(__eeprom char ‸a);\nvoid main(void) {  }", "error",
        "only a variable can be in the EEPROM, not a member, parameter, result or type"),
    ("xc8", "__eeprom char ‸a @ 0x20;\nvoid main(void) {  }", "error",
        "'a' in the EEPROM cannot have a fixed address"),
    ("xc8", "void f(char ‸x @ 0x20);\nvoid main(void) {  }", "error",
        "only a variable or a function can have a fixed address"),
    ("xc8", "struct ‸s { };\nvoid main(void) {  }", "error", "a structure needs a member"),
    ("xc8", "char b[9];void main(void) { ‸sprintf(b); }", "error", "'sprintf' needs a format string"),
    ("xc8", "char b[9]; const char *f;void main(void) { sprintf(b, ‸f); }", "error",
        "the format of 'sprintf' must be a string constant"),
    ("xc8", 'char b[9];void main(void) { sprintf(b, ‸"%f"); }', "error",
        "the format of 'sprintf': '%f' is not supported; there are %d %i %u %x %X %o %c %s, flags - 0 + and "
        "space, a width up to 255, hh h l"),
    ("xc8", 'char b[9];void main(void) { ‸sprintf(b, "%d"); }', "error",
        "'sprintf': there is no argument for %d"),
    ("xc8", 'char b[9];void main(void) { sprintf(b, "a", ‸5); }', "error",
        "'sprintf': the format has no conversion for this argument"),
    ("xc8", 'char b[9]; long v;void main(void) { sprintf(b, "%d", ‸v); }', "warning",
        "'sprintf': %d prints only the low 16 bits of 'long'"),
    ("xc8", "bit ‸f @ 0x30 = 1;\nvoid main(void) {  }", "error",
        "the bit 'f' at a fixed address cannot be initialised"),
    ("sdcc", "void main(void) { __critical { ‸goto out; } out: ; }", "error",
        "'goto' in a critical block is not supported"),
    ("sdcc", "void main(void) { while (1) { __critical { ‸break; } } }", "error",
        "'break' in a critical block cannot leave a loop or switch around it"),
    ("sdcc", "void main(void) __critical { if (1) ‸{", "error",
        "syntax error: the file ends in the middle of a declaration"),
    ("xc8", "int *p; int f(int n) { return n; }\nvoid main(void) { p = ‸f; *p = 1; }", "warning",
        "the assignment makes 'int *' from 'int (*)(int)' without a cast"),
    ("xc8", "int *p, (*f)(int);\nvoid main(void) { f = ‸p; f(1); }", "warning",
        "the assignment makes 'int (*)(int)' from 'int *' without a cast"),
    ("c2c", "‸#pragma DATA 0x2100, 300\nvoid main(void) {  }", "error",
        "#pragma DATA: '300' is not a number from 0 to 255"),
    ("c2c", "‸#pragma DATA 0x100, 3\nvoid main(void) {  }", "error",
        "#pragma DATA: no data can be placed at '0x100'"),
    ("xc8", "‸__IDLOC(12345);\nvoid main(void) {  }", "error",
        "__IDLOC takes up to four hexadecimal digits, not '12345'"),
    ("xc8", "char *f(void) { char a[2]; a[0] = 1; ‸return a; }\nchar x; void main(void) { x = *f(); }",
        "warning", "'a' no longer exists after 'f' returns"),
    ("xc8", "char x; int ‸f(int n) { if (n) return 1; }\nvoid main(void) { x = f(x); }", "warning",
        "'f' can reach its end without returning a value"),
    ("xc8", "char x; void main(void) { switch (x) { ‸case 300: x = 1; } }", "warning",
        "the case 300 is never reached: the value lies in 0 … 255"),
    ("xc8", "void main(void) { char ‸unused; }", "warning", "'unused' is never used"),
    ("xc8", "void main(void) { char ‸set; set = 5; set++; }", "warning", "'set' is set and never used"),
    ("xc8", "char x; void main(void) { char u; x = ‸u; }", "warning", "'u' is read before it is set"),
    ("xc8", "char x; void main(void) { char u, n = x; while (n--) { x += ‸u; } }", "warning",
        "'u' is read before it is set"),
    ("xc8", "char x; void main(void) { if (x & ‸x == 1) x = 1; }", "warning", "'==' is evaluated before '&'"),
    ("xc8", "char x; void main(void) { if (!‸x & 1) x = 2; }", "warning", "'!' is evaluated before '&'"),
    ("xc8", "char x; void main(void) { x = x << ‸1 + 2; }", "warning", "'+' is evaluated before '<<'"),
    ("xc8", "char x; void main(void) { while (x)‸;\n { x = 1; } }", "warning",
        "the body of this 'while' is this ';'"),
    ("xc8", "char x; void main(void) { for (x = 0; x < 5; x++)‸;\n { x = 1; } }", "warning",
        "the body of this 'for' is this ';'"),
    ("xc8", "char x, y; void main(void) { if (x) ‸if (y) x = 3; else x = 4; }", "warning",
        "the 'else' belongs to this 'if'"),
    ("xc8", "int i; void main(void) { ‸i = i++ + 1; }", "warning",
        "'i' is changed and used in one expression, in an undefined order"),
    ("xc8", "int i; char a[3]; void main(void) { ‸a[i] = i++; }", "warning",
        "'i' is changed and used in one expression, in an undefined order"),
    ("xc8", "struct { unsigned two : 2; } s; void main(void) { s.two = ‸9; }", "warning",
        "9 does not fit a bit-field of 2 bits"),
    ("xc8", "void __attribute__((noinline, ‸interrupt)) f(void) { } void main(void) { f(); }", "warning",
        "the attribute 'interrupt' is ignored"),
    ("xc8", "‸_Alignas(8) char x; void main(void) { x = 1; }", "warning", "the alignment is ignored"),
    ("xc8", "long big; void main(void) { big = ‸300 * 300; }", "warning",
        "300 * 300 is 90000, which does not fit 'int', and becomes 24464"),
    ("xc8", 'const char *t; char x; void main(void) { if (t == ‸"ab") x = 1; }', "warning",
        "this compares the address of a string, not its characters"),
    ("c2c", "#pragma CLOCK_FREQ 4000000\nint n; void main(void) { delay_ms(‸n); }", "warning",
        "'delay_ms' takes 0 to 255: only the low 8 bits of this 'int' are used"),
    ("xc8", "void main(void) { ‸GIE = 1; }", "warning", "GIE is set, but there is no interrupt function"),
    ("xc8", "void __interrupt() ‸f(void) { T0IF = 0; }\nvoid main(void) { T0IE = 1; }", "warning",
        "this interrupt function is never called: GIE is never set"),
    ("xc8", "char n; void __interrupt() ‸f(void) { n++; }\nvoid main(void) { INTCON = 0xA0; while (1); }",
        "warning", "this interrupt function never clears T0IF: it is called again as soon as it returns"),
    ("xc8", "void main(void) { ‸PORTB = 5; while (1); }", "warning",
        "all pins of PORTB are inputs: TRISB is never written"),
    ("xc8", "void main(void) { TRISA4 = 0; ‸RA4 = 1; while (1); }", "warning",
        "RA4 is an open-drain output: it is high only with a pull-up resistor"),
    ("xc8", "#pragma config WDTE = ON\nvoid ‸main(void) { while (1); }", "warning",
        "the watchdog is on and never cleared: it resets the chip again and again"),
    ("xc8", "char x ‸@ PORTB;\nvoid main(void) {  }", "error", "a fixed address must be a number"),
    ("xc8", "char x ‸@ y + 1;\nvoid main(void) {  }", "error", "a fixed address must be a number"),
    ("xc8", "‸#pragma config FOSC\nvoid main(void) {  }", "error",
        "'FOSC' is not a setting, which is written NAME = VALUE"),
    ("c2c", "‸asm __config nothing\nvoid main(void) {  }", "error", "'nothing' is not a configuration mask"),
    ("c2c", "‸#pragma CLOCK_FREQ fast\nvoid main(void) {  }", "error",
        "#pragma CLOCK_FREQ needs a frequency in hertz, not 'fast'"),
    ("xc8", "#pragma config WDTE = ON\n‸#pragma config WDTE = OFF\nvoid main(void) {  }", "error",
        "WDTE is set twice: ON and OFF"),
    ("xc8", "int x;void main(void) { if (x)‸; x = 1; }", "warning", "the body of this 'if' is this ';'"),
    ("xc8", "int x;void main(void) { ‸default: x = 1; }", "error", "'default' outside a switch"),
    ("xc8", "int x;void main(void) { switch (x) { default: ‸default: x = 1; } }", "error",
        "duplicate 'default'"),
    ("xc8", "int x;void main(void) { a: x = 1; ‸a: x = 2; }", "error", "duplicate label 'a'"),
    ("xc8", '_Static_assert(‸1 > 2, "no");\nvoid main(void) {  }', "error", "static assertion failed"),
    ("xc8", "int x; int f(void) { if (x) ‸return; return 1; }void main(void) { x = f(); }", "warning",
        "'f' should return 'int'"),
    ("xc8", "‸long long x;\nvoid main(void) {  }", "error", "64-bit integers are not supported"),
    ("xc8", "‸signed unsigned int x;\nvoid main(void) {  }", "error", "'signed unsigned int' is not a type"),
    ("xc8", "‸short char x;\nvoid main(void) {  }", "error", "'short char' is not a type"),
    ("xc8", "int y; ‸y x;\nvoid main(void) {  }", "error",
        "syntax error before 'y' (invalid function definition)"),
    ("xc8", "void ‸v[3];\nvoid main(void) {  }", "error", "an array of 'void' has no size"),
    ("xc8", "struct s ‸a[3];\nvoid main(void) {  }", "error", "'struct s' is not defined"),
    ("xc8", "struct s { int a; }; struct ‸s { int b; };\nvoid main(void) {  }", "error",
        "'s' is defined twice"),
    ("xc8", "struct s { void ‸a; };\nvoid main(void) {  }", "error", "a member cannot be of type 'void'"),
    ("xc8", "‸enum e x;\nvoid main(void) {  }", "error", "'enum e' is not defined"),
    ("xc8", "int f(int a, ‸...) { return a; }\nvoid main(void) {  }", "error",
        "functions with '...' parameters are not supported"),
    ("xc8", "void f(struct q ‸a) { }\nvoid main(void) {  }", "error", "'struct q' is not defined"),
    ("xc8", "void f(void ‸a) { }\nvoid main(void) {  }", "error", "a parameter cannot be of type 'void'"),
    ("xc8", "bit ‸*p;\nvoid main(void) {  }", "error", "there are no pointers to bits"),
    ("xc8", "struct s { unsigned ‸a : 17; };\nvoid main(void) {  }", "error",
        "a bit-field has 1 to 16 bits of an integer type"),
    ("xc8", "struct s { int a; int ‸a; };\nvoid main(void) {  }", "error", "duplicate member 'a'"),
    ("xc8", "‸#define\nvoid main(void) {  }", "error", "malformed preprocessor directive"),
    ("xc8", "struct s {int a;}; int x = ‸(struct s){1}.a;void main(void) {  }", "error",
        "a compound literal outside functions is not supported"),
    ("xc8", "‸#define F(\nint x;void main(void) { x = 1; }", "error",
        "preprocessor: Missing ')' in macro arguments"),
    ("xc8", "void main(void) { char ‸a[]; }", "error", "the size of the array 'a' is missing"),
    ("xc8", "int ‸x[2][]; void main(void) {  }", "error", "an array of 'int[]' has no size"),
]  # fmt: skip


@pytest.mark.parametrize(("dialect", "marked", "severity", "message"), ROWS)
def test_a_diagnostic_says_what_and_where(dialect: str, marked: str, severity: str, message: str) -> None:
    before, _, _ = marked.partition(CARET)
    line, column = before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1
    report = reported(dialect, marked.replace(CARET, ""))
    (found,) = report.diagnostics
    assert (found.severity, found.message) == (severity, message)
    assert (found.location.line, found.location.column) == (line, column)
    shown = found.render(report.source_lines).splitlines()
    caret = next(number for number, each in enumerate(shown) if each.strip() == "^")
    assert shown[caret].index("^") - 4 == column - 1
    assert shown[caret - 1][4:] == marked.replace(CARET, "").splitlines()[line - 1]


BRACKETS = [
    ("void main(void) { if (1 { ; } }", (1, 25), "the '(' at main.c:1:22 is not closed"),
    ("char x;\nvoid main(void) { x = (3 + 4; }", (2, 29), "the '(' at main.c:2:23 is not closed"),
    ("void main(void) { ; }}\nchar x;", (1, 22), "there is no '{' for it"),
    ("void main(void) { for (;) ; }", (1, 25), "'for' takes three parts with ';' between them"),
]


@pytest.mark.parametrize(("text", "place", "hint"), BRACKETS)
def test_brackets_that_do_not_match_are_shown(text: str, place: tuple[int, int], hint: str) -> None:
    (found,) = diagnostics("xc8", text)
    assert found.message.startswith("syntax error before")
    assert ((found.location.line, found.location.column), found.hint) == (place, hint)


@pytest.mark.parametrize(
    ("declaration", "end"),
    [("int total", "total"), ("char a, b[2]", "]"), ("enum e { x } y", "y")],
)
def test_a_declaration_without_an_end_is_told_where_it_stands(declaration: str, end: str) -> None:
    (found,) = diagnostics("xc8", f"{declaration}\nvoid main(void) {{ }}")
    assert found.message == f"syntax error: ';' is missing after '{end}'"
    assert (found.location.line, found.location.column) == (1, len(declaration) + 1)


def test_what_is_nested_too_deeply_is_said() -> None:
    (found,) = diagnostics("xc8", f"int x;\nvoid main(void) {{ x = {'(' * 3000}1{')' * 3000}; }}")
    assert found.message == "something in the program is nested too deeply"


def test_errors_of_several_functions_are_found_in_one_run() -> None:
    """A syntax error ends its function only, and what that declares does not count as missing."""
    text = (
        "void f(void) {\n x = ; }\nvoid g(void) {\n y = 1;\n delay_ms(300); }\nvoid main(void) { f(); g(); }"
    )
    found = diagnostics("c2c", "#pragma CLOCK_FREQ 4000000\n" + text)
    assert [(each.location.line, each.message) for each in found] == [
        (3, "syntax error before ';' (invalid expression)"),
        (5, "'y' is not declared"),
        (6, "'delay_ms' takes 0 to 255, not 300"),
    ]


def test_every_name_of_a_declaration_with_an_error_counts_as_declared() -> None:
    """Also those after an array: a second error about each use would hide the first."""
    (found,) = diagnostics("xc8", "char a[2] b, c[3], d;\nvoid main(void) { b = d; c[0] = a[1]; }")
    assert found.message == "syntax error before 'b'"


def messages(found: tuple[Diagnostic, ...]) -> list[str]:
    return [each.message for each in found]


def test_a_character_that_is_not_of_c_is_an_error() -> None:
    found = diagnostics("xc8", "int x;\nvoid main(void) { x = 1 ` 2; }")
    assert messages(found)[0] == "the character '`' has no meaning in C"


def test_a_clock_that_is_too_slow_for_a_variable_delay() -> None:
    found = diagnostics("c2c", "#pragma CLOCK_FREQ 32768\nchar n;\nvoid main() { delay_us(n); }")
    assert "'delay_us' with a variable argument needs a clock whose cycle is at most 1 µs" in messages(found)


def test_a_file_that_includes_itself_is_an_error() -> None:
    options = Options(include=lambda name, _: (name, '#include "a.h"\n'))
    with pytest.raises(InputError) as caught:
        compile_sources([Source('#include "a.h"\nvoid main(void) { }', "main.c")], options)
    assert messages(caught.value.diagnostics) == ["#include is nested more than 20 levels deep"]
