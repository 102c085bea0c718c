"""Layouts of structures, types of enumerations, bytes of initialisers, places of variables."""

from __future__ import annotations

import struct

import pytest

from servogen.compiler.ast.nodes import AddressByte, ExprStmt, Symbol
from servogen.compiler.ast.types import StructType
from tests.compiler.marked import found_in, stated
from tests.compiler.test_sema_expressions_lvalues_conversions import analysed, name, show

END = "\nvoid main(void) { }"


def symbol(text: str, wanted: str = "x", dialect: str = "xc8") -> Symbol:
    """Return a variable of a program."""
    return next(each for each in analysed(text + END, dialect).program.symbols if each.name == wanted)


LAYOUTS = [
    # members: name type offset[.bit/width]; the size
    ("char a; int b; long c;", "a:u8@0 b:s16@1 c:s32@3", 7),
    ("unsigned a : 3, b : 5, c : 1;", "a:u8@0.0/3 b:u8@0.3/5 c:b1@1.0/1", 2),
    ("unsigned a : 3, b : 6;", "a:u8@0.0/3 b:u8@1.0/6", 2),
    ("unsigned a : 8, b : 8;", "a:u8@0.0/8 b:u8@1.0/8", 2),
    ("unsigned a : 3; unsigned : 0; unsigned b : 2;", "a:u8@0.0/3 b:u8@1.0/2", 2),
    ("unsigned : 0; unsigned b : 2;", "b:u8@0.0/2", 1),
    ("unsigned a : 3; unsigned : 4; unsigned b : 1;", "a:u8@0.0/3 b:b1@0.7/1", 1),
    ("unsigned a : 2; char b; unsigned c : 2;", "a:u8@0.0/2 b:u8@1 c:u8@2.0/2", 3),
    ("signed a : 3; _Bool b : 1; bit c; unsigned d : 1;", "a:s8@0.0/3 b:b8@0.3/1 c:b1@0.4/1 d:b1@0.5/1", 1),
    ("unsigned a : 9, b : 7;", "a:u16@0.0/9 b:u8@1.1/7", 2),
    ("unsigned a : 9, b : 8;", "a:u16@0.0/9 b:u8@2.0/8", 3),
    ("unsigned a : 1, b : 9;", "a:b1@0.0/1 b:u16@1.0/9", 3),
    ("unsigned a : 15; signed b : 12; char c;", "a:u16@0.0/15 b:s16@2.0/12 c:u8@4", 5),
    ("unsigned a : 16, b : 1;", "a:u16@0.0/0 b:b1@2.0/1", 3),
    ("unsigned : 9; unsigned b : 1;", "b:b1@1.1/1", 2),
    ("char a; struct { char b; int c; }; char d;", "a:u8@0 b:u8@1 c:s16@2 d:u8@4", 5),
    ("struct { char b; } a; int : 3; char c;", "a:struct (unnamed 1)@0 c:u8@2", 3),
    ('enum { P, Q }; char a; _Static_assert(Q == 1, ""); int b;', "a:u8@0 b:s16@1", 3),
    ("struct t { char b; }; char a; struct t c;", "a:u8@0 c:struct t@1", 2),
    ("int a[3]; char *b; const char *c; float d;", "a:s16[3]@0 b:*u8@6 c:*u8@7 d:f@9", 12),
]


def members(text: str) -> tuple[str, int | None]:
    kind = symbol(text).type
    assert isinstance(kind, StructType)
    shown = []
    for member in kind.layout.members.values():
        bits = "" if member.bit is None else f".{member.bit}/{member.width}"
        shown.append(f"{member.name}:{name(member.type)}@{member.offset}{bits}")
    return " ".join(shown), kind.layout.size


@pytest.mark.parametrize(("body", "expected", "size"), LAYOUTS)
def test_the_layout_of_a_structure(body: str, expected: str, size: int) -> None:
    assert members(f"struct {{ {body} }} x;") == (expected, size)


@pytest.mark.parametrize(
    ("body", "expected", "size"),
    [
        ("char a; long b; int c;", "a:u8@0 b:s32@0 c:s16@0", 4),
        ("unsigned a : 3, b : 5; char c;", "a:u8@0.0/3 b:u8@0.0/5 c:u8@0", 1),
        ("unsigned a : 9, b : 3; char c;", "a:u16@0.0/9 b:u8@0.0/3 c:u8@0", 2),
        ("struct { char a; char b; }; int c;", "a:u8@0 b:u8@1 c:s16@0", 2),
    ],
)
def test_the_members_of_a_union_begin_together(body: str, expected: str, size: int) -> None:
    assert members(f"union {{ {body} }} x;") == (expected, size)


def width(most: int) -> str:
    return f"error c-bit: a bit-field has 1 to {most} bits of an integer type"


UNPLACED = "error c-address: only a variable or a function can have a fixed address"
NO_NAME = "error c-syntax: '{}' stands where no {} is declared"
INTERRUPTS = "error c-address: only a function can be an interrupt function"
KEPT = "error c-initialiser: 'x' keeps its value through a reset and cannot be initialised"
INTO_EEPROM = (
    "error c-unsupported: there are no pointers into the EEPROM // a pointer that is itself in the EEPROM is "
    "'char *__eeprom p'"
)
NOT_A_VARIABLE = "error c-type: only a variable can be in the EEPROM, not a member, parameter, result or type"
ERRORS = [
    ("struct { unsigned a : 16; } x;", []),
    ("struct { unsigned ‸a : 17; } x;", [width(16)]),
    ("struct { long ‸a : 17; } x;", [width(16)]), ("struct { char a : 8; } x;", []),
    ("struct { char ‸a : 9; } x;", [width(8)]), ("struct { int ‸a : -1; } x;", [width(16)]),
    ("struct { float ‸a : 3; } x;", [width(16)]), ("struct { bit ‸a : 9; } x;", [width(8)]),
    ("struct ‸s { } x, y[2]; struct { struct s x; } z;", ["error c-type: a structure needs a member"]),
    ("union ‸{ int : 0; } x;", ["error c-type: a union needs a member"]),
    ("int ‸x[0];", ["error c-type: an array needs at least one element, not 0"]),
    ("int ‸x[-1];", ["error c-type: an array needs at least one element, not -1"]),
    ("int x[1];", []), ("typedef char x[1024];", []),
    ("typedef char ‸x[1025];", ["error program-too-large: an array of 1025 bytes is larger than the "
        "chip's memory"]),
    ("typedef struct { char a[1024]; } x;", []),
    ("typedef struct { char ‸a[1024]; char b; } x;", [
        "error program-too-large: a structure of 1025 bytes is larger than the chip's memory"]),
    ("long double x; double long y; double z; ", []),
    *[(f"‸{kind} x;", ["error c-unsupported: 64-bit integers are not supported // "
        "the widest type is 32 bits"]) for kind in ("long long", "unsigned long long", "long long int",
        "int64_t", "uint_least64_t")],
    ("enum { A = 65535 } x;", []), ("enum { A = -32768, B = 32767 } x;", []),
    ("enum { A, ‸B = 65536 } x;", [
        "error c-number: the enumeration constant 'B' is 65536 // an enumeration holds 0 to 65535 or "
        "-32768 to 32767"]),
    ("enum { A = 65535, ‸B } x;", [
        "error c-number: the enumeration constant 'B' is 65536 // an enumeration holds 0 to 65535 or "
        "-32768 to 32767"]),
    ("enum { ‸A = -32769 } x;", [
        "error c-number: the enumeration constant 'A' is -32769 // an enumeration holds 0 to 65535 or "
        "-32768 to 32767"]),
    ("enum { A = -1, ‸B = 32768 } x;", [
        "error c-number: the enumeration constant 'B' is 32768 // an enumeration holds 0 to 65535 or "
        "-32768 to 32767"]),
    ("enum { A, ‸A } x;", ["error c-redeclared: 'A' is already declared"]),
    ("typedef int t; typedef int t; t x;", []),
    ("typedef int t; typedef char ‸t; ", ["error c-redeclared: 't' is already declared"]),
    ("int a; void ‸a(void);", ["error c-redeclared: 'a' is already declared // at main.c:1:5"]),
    ("static int a; void ‸a(void);", ["error c-redeclared: 'a' is already declared // at main.c:1:12"]),
    ("static int f(int); int a; void g(void) { a = f(1); } static int f(int x) { return x; }", []),
    ("static int f(int); static int ‸f(char x) { return x; }", [
        "error c-redeclared: 'f' was declared as 'int(int)' before, now as 'int(unsigned char)' // the "
        "other declaration is at main.c:1:12"]),
    ("void a(void); int ‸a;", ["error c-redeclared: 'a' is already declared // at main.c:1:6"]),
    ("int a; char ‸a;", ["error c-redeclared: 'a' is already declared // at main.c:1:5"]),
    ("int a; extern int a; int a;", []),
    ("extern int a[]; int a[3]; void f(void) { a[2] = sizeof a; }", []),
    ("extern char a; const char ‸a = 1;", [
        "error c-redeclared: 'a' is const in one declaration only // the other is at main.c:1:13"]),
    ("char a @ 0x20; extern char ‸a @ 0x21;", [
        "error c-redeclared: 'a' has two addresses: 0x20 and 0x21 // the other declaration is at "
        "main.c:1:6"]),
    ("int f(int); char ‸f(int);", [
        "error c-redeclared: 'f' was declared as 'int(int)' before, now as 'unsigned char(int)' // the "
        "other declaration is at main.c:1:5"]),
    ("int f(); int f(int x); int f(int y);", []),
    ("int f(int x) { return x; } int ‸f(int x) { return x; }", [
        "error c-redeclared: the function 'f' is defined twice // first at main.c:1:5"]),
    ("char x @ 0x0C;", []), ("char x @ 0x4F;", []),
    ("char ‸x @ 0x50;", ["error c-address: there is no memory at 0x50 for 1 byte // RAM is 0x0C to 0x4F"]),
    ("int ‸x @ 0x4F;", ["error c-address: there is no memory at 0x4F for 2 bytes // RAM is 0x0C to 0x4F"]),
    ("char ‸x[3] @ 0x4E;", ["error c-address: there is no memory at 0x4E for 3 bytes // RAM is 0x0C to "
        "0x4F"]),
    ("char x @ 0x8C;", []),
    ("char ‸x @ 0x7F;", ["error c-address: there is no memory at 0x7F for 1 byte // RAM is 0x0C to 0x4F"]),
    ("char ‸x @ 0x100;", ["error c-address: the address 0x100 is not in the data memory (0x00-0xFF)"]),
    ("char ‸x @ -1;", ["error c-address: the address 0x-1 is not in the data memory (0x00-0xFF)"]),
    ("char *x @ 0x20; char (*y)[3] @ 0x21; char (*z)(void) @ 0x22;", []),
    ("void f(void) @ 0x100;", []),
    ("void f(void ‸g(void) @ 0x100);", [UNPLACED]),
    ("void f(char ‸x @ 0x20); char y;", [UNPLACED]),
    ("void ‸f(void) @ 0x400;", ["error c-address: 'f' at 0x400 is not in the program memory (0x000-0x3FF)"]),
    ("void f(void) @ 0x10; void ‸f(void) @ 0x11;", ["error c-redeclared: 'f' has two addresses: 0x10 and "
        "0x11"]),
    ("const char ‸x[2] @ 0x3FF = {1, 2};", ["error c-address: 'x' at 0x3FF is not in the program "
        "memory (0x000-0x3FF)"]),
    ("const char x[2] @ 0x3FE = {1, 2};", []),
    ("void ‸f(void) @ PORTB.3;", ["error c-address: a fixed address must be a number"]),
    ("void f(char ‸__at(0x20)); char y;", [NO_NAME.format("__at", "name")]),
    ("struct s { char a; } ‸__at(0x20); char x;", [NO_NAME.format("__at", "name")]),
    ("void f(void) { char x = (char ‸__at(0x20))1; } char y;", [NO_NAME.format("__at", "name")]),
    ("char ‸interrupt x; void f(void) { }", [NO_NAME.format("interrupt", "function")]),
    ("void f(char ‸interrupt x) { }", [NO_NAME.format("interrupt", "function")]),
    ("typedef void ‸__interrupt() t; void f(void) { }", [NO_NAME.format("__interrupt", "function")]),
    ("void (*‸p)(void) __interrupt 0; void f(void) { }", [INTERRUPTS]),
    ("void f(void ‸g(void) __interrupt(0)); void g(void) { }", [INTERRUPTS]),
    ("void (*‸p)(void) __naked; void f(void) { }", ["error c-address: only a function can be naked"]),
    ("struct { persistent char ‸x; } y; char x;", ["error c-address: only a variable can be persistent"]),
    ("persistent void ‸f(void); char x;", ["error c-address: only a variable can be persistent"]),
    ("persistent char ‸x = 1;", [KEPT]), ("persistent const char ‸x;", [KEPT]),
    ("struct { char ‸m @ 0x20; } x;", [UNPLACED]),
    ("typedef char ‸t @ 0x20;", [UNPLACED]),
    ("__eeprom char ‸x @ 0x20;", ["error c-address: 'x' in the EEPROM cannot have a fixed address"]),
    ("__eeprom char ‸*x;", [INTO_EEPROM]), ("char __eeprom ‸**x;", [INTO_EEPROM]),
    ("__eeprom char x, (‸*y)[2];", [INTO_EEPROM]),
    ("void f(void) { char x = sizeof(__eeprom char ‸*); }", [INTO_EEPROM]),
    ("char * __eeprom x, y; char * __eeprom z[2];", []),
    ("__eeprom char ‸f(void);", [NOT_A_VARIABLE]),
    ("void f(__eeprom char ‸x);", [NOT_A_VARIABLE]),
    ("struct { __eeprom char ‸x; } y;", [NOT_A_VARIABLE]),
    ("typedef __eeprom char ‸t;", [NOT_A_VARIABLE]),
    ("void f(void) { char x = (__eeprom ‸char)1; }", [NOT_A_VARIABLE]),
    ("extern __eeprom char x; __eeprom char x = 1;", []),
    ("extern char x; __eeprom char ‸x;", [
        "error c-redeclared: 'x' is __eeprom in one declaration only // the other is at main.c:1:13"]),
    ("char flags; bit x @ &flags*8+7;", []),
    ("char flags; bit ‸x @ &flags*8+8;", ["error c-bit: 'unsigned char' has no bit 8"]),
    ("int flags; bit x @ &flags*8+15;", []),
    ("bit ‸x @ &flags*8;", ["error c-undeclared: 'flags' is not declared"]),
    ("bit x @ 0x30.7; bit y @ 0x183; bit z @ PORTB.7;", []),
    ("bit ‸x @ 0x30.8;", ["error c-bit: 'unsigned char' has no bit 8"]),
    ("bit ‸x @ 0x438;", ["error c-address: there is no memory at 0x87 for 1 byte // RAM is 0x0C to 0x4F"]),
    ("char ‸x @ PORTB.7;", ["error c-address: a fixed address must be a number"]),
    ("const char ‸x;", ["c-initialiser: the constant 'x' has no value; it is 0"]),
    ("extern const char x;", []),
    ("void f(void) { char x[68]; x[0] = 1; }", []),
    ("void f(void) { char ‸x[69]; (void)x; }", [
        "error program-too-large: 'x' needs 69 bytes of RAM, the chip has 68"]),
    ("char x[3] = ‸\"abcd\";", ["error c-initialiser: the string of 4 characters does not fit an array "
        "of 3"]),
    ("char x[3] = \"abc\";", []),
    ("struct { char a, b, c; } x = {‸1};", ["c-initialiser: the member 'b' has no value and starts with 0"]),
    ("struct { char a, b, c; } x = {‸1, 2};", ["c-initialiser: the member 'c' has no value and starts "
        "with 0"]),
    ("struct { char a, b, c; } x = {0};", []),
    ("struct { char a, b, c; } x = {.a = 1};", []),
    ("struct { char a, b; } x = {1, 2};", []), ("int x[3] = {1};", []),
    ("int x[3] = {1, [0] = ‸2};", ["c-initialiser: this element already has a value"]),
    ("int x[3] = {[1] = 1, 2, [0] = 3};", []),
    ("int x[3] = {[2] = 1, ‸2};", ["error c-initialiser: too many initialisers for 'int[3]'"]),
    ("int x[3] = {[3] = ‸1};", ["error c-initialiser: this element does not exist"]),
    ("union { char a; int b; } x = {1};", []),
    ("union { char a; int b; } x = {1, ‸2};", ["error c-initialiser: too many initialisers for 'union "
        "(unnamed 1)'"]),
    ("int x = {1};", []),
    ("int x = {‸1, 2};", ["error c-initialiser: 'int' takes one initialiser, 2 are given"]),
    ("int y; int x = ‸y + 1;", ["error c-not-constant: the initialiser must be a constant"]),
    ("int y[3]; int *x = y + 1;", []),
    ("char a; __eeprom char ‸x = (char)&a;", ["error c-not-constant: the initialiser must be a constant"]),
    ("char a; __eeprom int ‸x[2] = {1, (int)&a};", [
        "error c-not-constant: the initialiser must be a constant"]),
    ("char a; ‸__EEPROM_DATA(1, 2, 3, 4, 5, 6, 7, (char)&a);", [
        "error c-not-constant: the initialiser must be a constant"]),
    ("char a; const int ‸x @ 0x2007 = (int)&a;", [
        "error c-not-constant: the initialiser must be a constant"]),
    # the type of a function by a name for it (ISO C 6.7.8); a definition needs its parameters (6.9.1)
    ("typedef int fn(int x); fn f, g; int f(int y) { return y + f(y); }", []),
    ("typedef int fn(int x); fn f; char ‸f(int x) { return x; }", [
        "error c-redeclared: 'f' was declared as 'int(int)' before, now as 'unsigned char(int)' // the "
        "other declaration is at main.c:1:27"]),
    ("typedef int fn(int x); fn ‸f { return 1; }", ["error c-syntax: 'f' is not a function but has a body"]),
    ("typedef void fn(void); fn f; void g(void) { f(); ‸f(1); }", [
        "error c-argument: 'f' takes 0 arguments, 1 is given // it is declared at main.c:1:27"]),
    ("struct { char a; ‸int; } x;", ["error c-syntax: this member has no name"]),
    ("typedef int T; struct s { ‸T; };", ["error c-syntax: this member has no name"]),
    ("int y; struct { unsigned a : 3; } x = {‸(unsigned)&y};", [
        "error c-not-constant: the initialiser must be a constant"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), ERRORS)
def test_what_a_declaration_may_be(text: str, said: list[str]) -> None:
    marked = text + END
    found = [each for each in found_in(marked) if not each[0].startswith("c-unused")]
    assert found == stated(marked, said)


@pytest.mark.parametrize(
    ("enumerators", "kind", "values"),
    [
        ("A, B, C", "u8", [0, 1, 2]), ("A = 255", "u8", [255]), ("A = 256", "s16", [256]),
        ("A = 255, B", "s16", [255, 256]), ("A = -1, B", "s16", [-1, 0]), ("A = 32767", "s16", [32767]),
        ("A = 32768", "u16", [32768]),
        ("A = 65535, B = 1, C", "u16", [65535, 1, 2]),
        ("A = 5, B = A + 2, C = B * B", "u8", [5, 7, 49]),
    ],
)  # fmt: skip
def test_the_type_of_an_enumeration_and_its_constants(enumerators: str, kind: str, values: list[int]) -> None:
    names = [each.split("=")[0].strip() for each in enumerators.split(",")]
    text = f"enum e {{ {enumerators} }} x; const long y[] = {{ {', '.join(names)} }};"
    assert name(symbol(text).type) == kind
    assert contents(symbol(text, "y")) == struct.pack(f"<{len(values)}l", *values)


def contents(variable: Symbol) -> bytes:
    """Return the bytes that a variable starts with."""
    initial = variable.initial or {}
    assert all(0 <= offset < variable.size for offset in initial)
    return bytes(byte for offset in range(variable.size) if isinstance(byte := initial.get(offset, 0), int))


# declaration, struct's format for its bytes, the values
BYTES: list[tuple[str, str, tuple[float, ...]]] = [
    ("int x = 300;", "<h", (300,)), ("int x = -2;", "<h", (-2,)),
    ("long x = 0x12345678;", "<l", (0x12345678,)),
    ("unsigned char x = 'A';", "<B", (65,)), ("int x = {7};", "<h", (7,)),
    ("int x[3] = {1, 2};", "<3h", (1, 2, 0)), ("int x[] = {1, 2, 3};", "<3h", (1, 2, 3)),
    ("int x[] = {[2] = 5, 6};", "<4h", (0, 0, 5, 6)),
    ("int x[] = {1, [4] = 5, [1] = 2};", "<5h", (1, 2, 0, 0, 5)),
    ("int x[3] = {[1] = 5};", "<3h", (0, 5, 0)),
    ("int x[2][2] = {{1, 2}, {3, 4}};", "<4h", (1, 2, 3, 4)),
    ("int x[2][2] = {1, 2, 3};", "<4h", (1, 2, 3, 0)),
    ("int x[][2] = {1, 2, 3};", "<4h", (1, 2, 3, 0)),
    ("int x[][2] = {1, 2, 3, 4};", "<4h", (1, 2, 3, 4)),
    ("int x[][2] = {{1}, {2}, {3}};", "<6h", (1, 0, 2, 0, 3, 0)),
    ("int x[2][2] = {[1] = {5}};", "<4h", (0, 0, 5, 0)),
    ("char x[] = \"ab\";", "<3s", (b"ab",)), ("char x[] = {\"ab\"};", "<3s", (b"ab",)),
    ("char x[5] = \"ab\";", "<5s", (b"ab",)), ("char x[2] = \"ab\";", "<2s", (b"ab",)),
    ("char x[][3] = {\"ab\", \"c\"};", "<3s3s", (b"ab", b"c")),
    ("char x[] = \"a\\x41\\101\\n\" \"z\";", "<6s", (b"aAA\nz",)),
    ("char x[] = \"\\n\\t\\r\\a\\b\\f\\v\\\\\\'\\\"\\?\\0\";", "<13s", (b"\n\t\r\a\b\f\v\\'\"?",)),
    ("struct { char a; int b; } x = {1, 2};", "<bh", (1, 2)),
    ("struct { char a; int b; } x = {.b = 2, .a = 1};", "<bh", (1, 2)),
    ("struct { int a[2]; char b; } x = {1, .b = 3};", "<hhb", (1, 0, 3)),
    ("struct { char a; int b; } x[2] = {{1, 2}, {3, 4}};", "<bhbh", (1, 2, 3, 4)),
    ("struct { char a; int b; } x[2] = {1, 2, 3, 4};", "<bhbh", (1, 2, 3, 4)),
    ("struct { char a; int b; } x[] = {1, 2, 3, 4, 5};", "<bhbhbh", (1, 2, 3, 4, 5, 0)),
    ("struct { char a; int b; } x[] = {1, 2, {3, 4}, 5};", "<bhbhbh", (1, 2, 3, 4, 5, 0)),
    ("struct { char a; int b[2]; } x[] = {1, 2, 3, 4};", "<bhhbhh", (1, 2, 3, 4, 0, 0)),
    ("union { char a; int b; } x[] = {1, 2, 3};", "<bxbxbx", (1, 2, 3)),
    ("struct { char n[3]; int v; } x[] = {\"ab\", 258, \"c\", 3, {\"de\", 4}};", "<3sh3sh3sh", (b"ab", 258,
        b"c", 3, b"de", 4)),
    ("struct { char n[2][3]; char v; } x[] = {\"ab\", \"c\", 1, \"d\"};", "<3s3sb3s3sb", (b"ab", b"c", 1,
        b"d", b"", 0)),
    ("int x[][2][2] = {1, 2, 3, 4, 5};", "<8h", (1, 2, 3, 4, 5, 0, 0, 0)),
    ("int x[][2] = {[1] = {5}, 6};", "<6h", (0, 0, 5, 0, 6, 0)),
    ("struct { char a; struct { int b[2]; } c; } x = {1, {{2, 3}}};", "<bhh", (1, 2, 3)),
    ("struct { char a; struct { int b[2]; } c; } x = {1, 2, 3};", "<bhh", (1, 2, 3)),
    ("struct { char a; struct { char b, c; }; } x = {1, {2, 3}};", "<bbb", (1, 2, 3)),
    ("struct { char a; struct { char b, c; }; } x = {.a = 1, .c = 3};", "<bbb", (1, 0, 3)),
    ("struct { char a; struct { char b, c; }; } x = {.a = 1, .b = 2, .c = 3};", "<bbb", (1, 2, 3)),
    ("union { char a; int b; } x = {5};", "<h", (5,)),
    ("union { char a; int b; } x = {.b = 500};", "<h", (500,)),
    ("struct { unsigned a : 3, b : 5; } x = {5, 17};", "<B", (5 | 17 << 3,)),
    ("struct { unsigned a : 3, b : 2, c : 4; } x = {.c = 9, .b = 2};", "<BB", (2 << 3, 9)),
    ("struct { signed a : 3, b : 3; } x = {-1, -2};", "<B", (7 | 6 << 3,)),
    ("struct { unsigned a : 9, b : 7; } x = {0x155, 0x55};", "<H", (0x155 | 0x55 << 9,)),
    ("struct { signed a : 12; unsigned b : 3; } x = {-5, 5};", "<H", (-5 & 0xFFF | 5 << 12,)),
    ("long x = 3 * 5 - 1;", "<l", (14,)), ("int x = (char)300;", "<h", (44,)),
    ("int x = sizeof(long);", "<h", (4,)),
    ("float x = 1.5;", "<3s", (struct.pack("<f", 1.5)[1:],)),
    ("float x[2] = {2, -0.25};", "<3s3s", (struct.pack("<f", 2)[1:], struct.pack("<f", -0.25)[1:])),
    ("char *x = (char *)0x20;", "<B", (0x20,)), ("const char *x = 0;", "<H", (0,)),
    ("const int n = 5; int x = n + 1;", "<h", (6,)),
]  # fmt: skip


@pytest.mark.parametrize("qualifier", ["", "const "])
@pytest.mark.parametrize(("text", "form", "values"), BYTES)
def test_the_bytes_of_an_initialiser(
    text: str, form: str, values: tuple[object, ...], qualifier: str
) -> None:
    expected = struct.pack(form, *values)
    variable = symbol(text if "*" in text else qualifier + text)  # a pointer to const has another size
    assert (contents(variable), variable.size) == (expected, len(expected))


def test_addresses_in_an_initialiser() -> None:
    text = "int y[4]; struct { char a; int b; } s; int *x[4] = {y, &y[1], y + 2, &y[3] - 1}; int *z = &s.b;"
    for wanted, offsets in (("x", (0, 2, 4, 4)), ("z", (1,))):
        initial = symbol(text, wanted).initial
        assert initial is not None
        parts = [part for part in initial.values() if isinstance(part, AddressByte)]
        assert [(part.symbol.name, part.offset, part.part) for part in parts] == [
            ("y" if wanted == "x" else "s", offset, 0) for offset in offsets
        ]
    # an address of one byte in a wider object is followed by the layout's upper bytes of it
    for kind, size in (("unsigned char", 1), ("unsigned", 2), ("long", 4)):
        initial = symbol(f"int y[4]; {kind} x = ({kind})&y[1];").initial
        assert initial is not None
        parts = [part for part in initial.values() if isinstance(part, AddressByte)]
        assert [(part.symbol.name, part.offset, part.part) for part in parts] == [
            ("y", 2, number) for number in range(size)
        ]
    wide = symbol("const char y[3] = {1}; const char *x = y + 2;").initial
    assert wide is not None
    assert [(part.offset, part.part) for part in wide.values() if isinstance(part, AddressByte)] == [
        (2, 0),
        (2, 1),
    ]


LOCALS = [
    ("int x = a;", ["(x = (s16)a)"]), ("int x = {a};", ["(x = (s16)a)"]),
    ("char x[3] = {1, a};", ["(x = 1:u8)", "(x+1 = a)", "(x+2 = 0:u8)"]),
    ("char x[3] = \"hi\";", ["(x = 104:u8)", "(x+1 = 105:u8)", "(x+2 = 0:u8)"]),
    ("int x[2] = {[1] = a};", ["(x = 0:s16)", "(x+2 = (s16)a)"]),
    ("struct { char c; int n; } x = {a, 5};", ["(x = a)", "(x+1 = 5:s16)"]),
    ("struct { char c; int n; } x = {.n = 5};", ["(x = 0:u8)", "(x+1 = 5:s16)"]),
    ("struct { unsigned u : 3, v : 2; char c; } x = {a, 1, 2};", ["(x = 0:u8)", "(x+1 = 2:u8)",
        "(x.0/3 = a)", "(x.3/2 = 1:u8)"]),
    ("union { char c; int n; } x = {a};", ["(x = a)", "(x+1 = 0:u8)"]),
    ("union { char c; int n; } x = {.n = a};", ["(x = (s16)a)"]),
    ("struct s x = o;", ["(x = o)"]), ("const char x = a;", ["(x = a)"]),
    ("const char x = 5; a = x;", ["(a = 5:u8)"]),
    ("static int x = 5; a = x;", ["(a = (u8)x)"]),
    ("float x = a;", ["(x = float_from_integer((u16)a):f)"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "steps"), LOCALS)
def test_the_assignments_of_a_local_initialiser(text: str, steps: list[str]) -> None:
    head = "unsigned char a; struct s { char c[2]; } o;\n"
    block = analysed(f"{head}void f(void) {{ {text} }}{END}").program.functions["f"].body
    assert block is not None
    assert [show(each.expr) for each in block.body if isinstance(each, ExprStmt)] == steps


def test_variables_lie_where_their_declarations_say() -> None:
    text = (
        "char a; const char b = 1; char c @ 0x30; volatile char d; char e @ 0x06; char f @ 0x85; char g "
        "@ 0x8C;\n"
        "__eeprom char h = 5; __eeprom int i[2] = {1, 2}; const volatile char j;\n"
    )
    program = analysed(text + END).program
    where = {each.name: (each.kind, each.address, each.volatile, each.bank1) for each in program.symbols}
    assert where == {
        "a": ("global", None, False, False), "b": ("flash", None, False, False),
        "c": ("fixed", 0x30, False, False), "d": ("global", None, True, False),
        "e": ("fixed", 0x06, True, False), "f": ("fixed", 0x85, True, True),
        "g": ("fixed", 0x8C, True, False), "j": ("global", None, True, False),
    }  # fmt: skip
    assert program.eeprom == {0: 5, 1: 1, 2: 0, 3: 2, 4: 0}


def test_blocks_that_declare_one_external_variable_share_it() -> None:
    text = "void f(void) { extern int x; x = 2; } void g(void) { extern int x; extern char y; x = y; }"
    assert [(each.name, each.kind) for each in analysed(text + END).program.symbols] == [
        ("x", "global"),
        ("y", "global"),
    ]


def test_the_eeprom_is_filled_in_the_order_of_the_declarations() -> None:
    data = "__EEPROM_DATA(1, 2, 3, 4, 5, 6, 7, 8);\n"
    program = analysed("__eeprom char x = 9;\n" + data + END).program
    assert program.eeprom == {**dict(enumerate(range(1, 9))), 8: 9}
    full = 8 * data
    assert analysed(full + END).program.eeprom == dict(enumerate(8 * list(range(1, 9))))
    assert analysed("#pragma DATA 0x2103, 77\n" + data + END).program.eeprom[3] == 77
    marked = f"__eeprom char a[63];\n__eeprom char b, ‸c;{END}"
    said = ["error program-too-large: 'c' ends at byte 65 of the EEPROM, which has 64"]
    assert found_in(marked) == stated(marked, said)
    marked = f"const char ‸a[2] @ 0x213F = {{1, 2}};{END}"
    said = ["error c-address: 'a' ends at byte 65 of the EEPROM, which has 64"]
    assert found_in(marked) == stated(marked, said)
    program = analysed(f"const char a[2] @ 0x213E = {{1, 2}};{END}").program
    assert program.eeprom == {62: 1, 63: 2}


@pytest.mark.parametrize("dialect", ["xc8", "c2c"])
def test_a_parameter_without_a_type_is_an_int(dialect: str) -> None:
    """As C had it before 1999: `int f(a, b) char b; { … }`. In C2C an int has no sign."""
    text = "int f(a, b, c) char b; { return a + b + c; }"
    parameters = analysed(text + END, dialect).program.functions["f"].parameters
    word = "s16" if dialect == "xc8" else "u16"
    assert [(each.name, name(each.type)) for each in parameters] == [("a", word), ("b", "u8"), ("c", word)]


def test_a_function_declared_by_a_typedef_has_parameters_without_names() -> None:
    functions = analysed("typedef long fn(char x, int *); fn f;" + END).program.functions
    found = [(each.name, name(each.type)) for each in functions["f"].parameters]
    assert found == [("argument1", "u8"), ("argument2", "*s16")]
    assert (name(functions["f"].result), functions["f"].prototyped) == ("s32", True)
