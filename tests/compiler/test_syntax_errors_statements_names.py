"""Errors of syntax, of statements, of types and names: each with its place, words and hint."""

from __future__ import annotations

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.compiler.diagnostics import Fatal, Reporter, is_own_file
from servogen.compiler.frontend.preprocessor import PToken
from servogen.compiler.frontend.syntax_errors import declared
from servogen.compiler.limits import ERRORS
from servogen.errors import Diagnostic, InputError, Location
from servogen.pic.device import device
from tests.compiler.marked import CARET, diagnostics, found_in, line_of, stated

# syntax

SYNTAX = [
    ("int x‸\nvoid main(void) { }", ["';' is missing after 'x'"]),
    ("int x[3]‸\nint y;\nvoid main(void) { }", ["';' is missing after ']'"]),
    ("void main(void) {\n PORTB = 1‸\n PORTA = 2;\n}", ["';' is missing after '1'"]),
    ("void main(void) {\n f(1)‸\n x = 2;\n}", ["';' is missing after ')'"]),
    ("void main(void) { x = 1‸ }", ["';' is missing after '1'"]),
    ("void main(void) { x = 1‸ return; }", ["';' is missing after '1'"]),
    ("void main(void) { x = 1‸ if (x) ; }", ["';' is missing after '1'"]),
    ("void main(void) { int y‸ int z; }", ["';' is missing after 'y'"]),
    ("void main(void) { x = 1 ‸y; }", ["before 'y'"]),
    ("void main(void) { x = ‸; }", ["before ';' (invalid expression)"]),
    ("void main(void) { x = (1 + 2‸; }", ["before ';' // the '(' at main.c:1:23 is not closed"]),
    ("void main(void) { if (x ‸{ } }", ["before '{' // the '(' at main.c:1:22 is not closed"]),
    ("void main(void) { f(1 ‸} }", ["before '}' // the '(' at main.c:1:20 is not closed"]),
    ("void main(void) { x = (1\n ‸return; }", ["before 'return' // the '(' at main.c:1:23 is not closed"]),
    ("void main(void) { x = (1\n ‸y; }", ["before 'y'"]),
    ("void main(void) { for (x = 0‸\n x < 3; x++) ; }", ["';' is missing after '0'"]),
    ("void main(void) { for (x = 0; x < 3‸) ; }", ["before ')' // 'for' takes three parts with ';' "
        "between them"]),
    ("void main(void) { } ‸}", ["before '}' // there is no '{' for it"]),
]  # fmt: skip


@pytest.mark.parametrize(("marked", "said"), SYNTAX)
def test_a_syntax_error_is_where_the_parser_stopped(marked: str, said: list[str]) -> None:
    expected = [f"error c-syntax: syntax error{':' if 'missing' in each else ''} {each}" for each in said]
    undeclared = "error c-undefined: there is no function 'main'"
    assert [each for each in found_in(marked) if each[0] != undeclared] == stated(marked, expected)


def test_a_file_that_ends_too_early() -> None:
    for text, last, hint in (
        ("void main(void) {\n x = 1;", (2, 7), "the '{' at main.c:1:17 is not closed"),
        ("void main(void) { f(x", (1, 21), "the '{' at main.c:1:17 is not closed"),
        ("int x[3", (1, 7), "the '[' at main.c:1:6 is not closed"),
        ("int f(int x", (1, 11), "the '(' at main.c:1:6 is not closed"),
    ):
        said = f"error c-syntax: syntax error: the file ends in the middle of a declaration // {hint}"
        assert found_in(text)[0] == (said, *last)
    said = "error c-syntax: syntax error: the file ends in the middle of a declaration"
    assert found_in("int x")[0] == (said, 1, 5)


def test_parsing_resumes_after_each_kind_of_end() -> None:
    """After a `;` outside braces, the brace that ends a function, at a declaration in the first column."""
    text = (
        "int a b;\nvoid f(void) { x = ; { y = ; } }\nint c d;\n"
        "void g(void) { if (1 {\n x = 1;\n}\nvoid h(void) { int e f; }\nvoid main(void) { q = 1; }\n"
    )
    found = [each for each in diagnostics(text) if each.location]
    assert [(each.location.line, each.message) for each in found if each.location] == [
        (1, "syntax error before 'b'"),
        (2, "syntax error before ';' (invalid expression)"),
        (3, "syntax error before 'd'"),
        (4, "syntax error before '{'"),
        (7, "syntax error before 'f'"),
        (8, "'q' is not declared"),
    ]


def test_a_declaration_before_which_a_statement_should_end_does_not_end_its_function() -> None:
    text = "void f(void) { do { a; }\nint g;\n}\nint x y;\n"
    found = [(each.location.line, each.message) for each in diagnostics(text) if each.location]
    assert found == [(2, "syntax error before 'int'"), (4, "syntax error before 'y'")]


def test_what_a_broken_declaration_may_declare_stands_outside_all_brackets() -> None:
    words = "static f ( int a , g ( b ) ) { c ; { d } e } , x [ i ] = 3 ; y"
    assert declared([PToken(word, Location()) for word in words.split()]) == {"static", "f", "x", "y"}


NUMBERS = [
    ("‸08", "'08' is not a number: octal digits are 0 to 7"),
    ("‸019u", "'019u' is not a number: octal digits are 0 to 7"),
    ("‸12q", "'12q' is not a number"),
    ("‸1lul", "'1lul' is not a number: unknown suffix 'lul'"),
    ("‸0xG", "'0xG' is not a number"),
    ("‸1.2.3", "'1.2.3' is not a number"),
    ("‸4294967296", "4294967296 does not fit in 32 bits"),
    (f"‸{'9' * 40}", f"{'9' * 40} does not fit in 32 bits"),
    (f"‸{'9' * 41}", f"{'9' * 40}… does not fit in 32 bits"),
    ("‸'ab'", "a character constant holds one character"),
    ("‸''", "a character constant holds one character"),
    ("‸0x1FFFFFFFF", "0x1FFFFFFFF does not fit in 32 bits"),
    (f"‸{'9' * 399}.0", f"{'9' * 399}.0 does not fit 'float'"),
    (f"‸{'9' * 400}.0", "the number has more than 400 digits"),
    ("‸1e39", "1e39 does not fit 'float'"),
    ("‸1e99999", "1e99999 does not fit 'float'"),
    ("‸0x1p128", "0x1p128 does not fit 'float'"),
]


@pytest.mark.parametrize(("marked", "said"), NUMBERS)
def test_a_number_that_is_none(marked: str, said: str) -> None:
    variable = "f" if "float" in said or "400" in said else "x"
    text = f"unsigned long x; float f;\nvoid main(void) {{ {variable} = {marked}; }}"
    assert found_in(text)[:1] == stated(text, [f"error c-number: {said}"])


@pytest.mark.parametrize("text", [
    "4294967295", "0xFFFFFFFF", "037777777777", "07", "1ul", "1LL", "1uLL", "'\\''",
    "1e38", "0x1p127", ".5", "5.", "1.e2f",
])  # fmt: skip
def test_numbers_that_fit(text: str) -> None:
    kind = "float" if set(text) & set(".p") or "e3" in text else "unsigned long"
    assert found_in(f"{kind} x;\nvoid main(void) {{ x = {text}; }}") == []


@pytest.mark.parametrize(
    "marked",
    [
        "char ‸a[100]; for (i = 0; i < 3; i++) a[i] = i; i = a[2];",
        "struct nothing ‸a; a.x = 1; i = sizeof(a);",
        "char a[‸i]; a[i] = i; a[1] = a(1); i = (a);",
        "typedef struct nothing ‸a[2]; a b; b[1].x = 3;",
        "{ char ‸a[100]; a[0] = 1; } i = a;",
        "for (char ‸a[100]; a[0] < 3; a[0]++) a[1] = 3; i = a;",
    ],
)
def test_the_uses_of_a_name_whose_declaration_is_wrong_are_not_reported(marked: str) -> None:
    found = found_in(f"char a; int i;\nvoid main(void) {{ {marked} }}")
    (line, column) = 2, len("void main(void) { ") + marked.index(CARET) + 1
    assert [where for _, *where in found] == [[line, column]]


# statements

JUMPS = [
    ("‸break;", "error c-jump: 'break' outside a loop or switch"),
    ("‸continue;", "error c-jump: 'continue' outside a loop"),
    ("switch (a) { case 1: ‸continue; }", "error c-jump: 'continue' outside a loop"),
    ("switch (a) { case 1: break; }", ""), ("switch (a) case 1: a = 2;", ""),
    ("while (a) { switch (a) { case 1: continue; } }", ""),
    ("while (a) { } ‸break;", "error c-jump: 'break' outside a loop or switch"),
    ("switch (a) { case 1: a = 2; } ‸break;", "error c-jump: 'break' outside a loop or switch"),
    ("‸case 1: a = 1;", "error c-jump: 'case' outside a switch"),
    ("switch (a) { case 1: a = 2; } ‸case 2: a = 1;", "error c-jump: 'case' outside a switch"),
    ("‸default: a = 1;", "error c-jump: 'default' outside a switch"),
    ("switch (a) { case 1: a = 1; break; ‸case 1: a = 2; }", "error c-jump: duplicate case 1"),
    ("switch (a) { case 255: a = 1; }", ""),
    ("switch (a) { ‸case 256: a = 1; }", "c-case-range: the case 256 is never reached: the value lies "
        "in 0 … 255"),
    ("switch (a) { ‸case -1: a = 1; }", "c-case-range: the case -1 is never reached: the value lies in "
        "0 … 255"),
    ("switch (a) { case ‸a: a = 1; }", "error c-not-constant: a case must be a constant"),
    ("switch (a) { ‸a = 2; case 1: a = 1; }", "c-unreachable: this is never reached: it stands before "
        "the first case"),
    ("switch (‸f) { case 1: a = 1; }", "error c-type: an integer is needed here, not 'float'"),
    ("‸goto out;", "error c-jump: there is no label 'out' in 'main' "),
    ("‸out: a = 1;", "c-unused: nothing jumps to 'out'"),
    ("out: a = 1; goto out;", ""),
    ("return; ‸a = 1;", "c-unreachable: this is never reached"),
    ("return; ‸a = 1; a = 2;", "c-unreachable: this is never reached"),
    ("return; ;", ""), ("return; return;", ""),
    ("while (1) ; ‸a = 1;", "c-unreachable: this is never reached"),
    ("while (1) { if (a) break; } a = 1;", ""),
    ("if (a) return; else return; ‸a = 1;", "c-unreachable: this is never reached"),
    ("if (a) return; a = 1;", ""), ("if (a) return; else a = 2; a = 1;", ""),
    ("{ a = 2; return; } ‸a = 1;", "c-unreachable: this is never reached"),
    ("while (a) { continue; ‸a = 1; }", "c-unreachable: this is never reached"),
    ("goto x; ‸a = 1; x: a = 2;", "c-unreachable: this is never reached"),
    ("goto x; { x: a = 2; }", ""),
    ("if (‸a = 1) i = 2;", "c-assignment-condition: an assignment is used as a condition // '==' "
        "compares; write '((a = b))' if the assignment is meant"),
    ("if ((a = 1)) i = 2;", ""),
    ("while (‸a = i) i = 2;", "c-assignment-condition: an assignment is used as a condition // '==' "
        "compares; write '((a = b))' if the assignment is meant"),
    ("do i = 2; while (‸a = i);", "c-assignment-condition: an assignment is used as a condition // '==' "
        "compares; write '((a = b))' if the assignment is meant"),
    ("for (; ‸a = i; ) i = 2;", "c-assignment-condition: an assignment is used as a condition // '==' "
        "compares; write '((a = b))' if the assignment is meant"),
    ("if (a += 1) i = 2;", ""),
    ("‸a == 1;", "c-no-effect: this comparison has no effect // '=' assigns, '==' compares"),
    ("‸a != 1;", "c-no-effect: this statement has no effect"),
    ("‸a;", "c-no-effect: this statement has no effect"),
    ("‸5;", "c-no-effect: this statement has no effect"),
    ("‸a, i = 1;", "c-no-effect: this statement has no effect"),
    ("*‸p++;", "c-unused-result: the value that the pointer points to is read but not used // '(*p)++' "
        "changes it, 'p++' moves the pointer"),
    ("(*p)++;", ""), ("v;", ""),
    ("‸v + 1;", "c-unused-result: the result of this expression is not used"),
    ("-‸v;", "c-unused-result: the result of this expression is not used"),
    ("(void)a;", ""), ("a && (i = 1);", ""), ("a ? (i = 1) : 0;", ""),
    ("‸return 1;", "error c-return: 'main' returns void and cannot return a value"),
    ("_Static_assert(1, \"x\");", ""), ("_Pragma(\"x\") a = 2;", ""),
    ("_Static_assert(‸a, \"x\");", "error c-not-constant: a static assertion must be a constant"),
    ("a = i == 3 ? 1 : ‸x;", "error c-undeclared: 'x' is not declared"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), JUMPS)
def test_a_statement_in_its_place(text: str, said: str) -> None:
    marked = f"unsigned char a, *p; volatile char v; int i; float f;\nvoid main(void) {{ {text} }}"
    assert found_in(marked) == stated(marked, [said.rstrip()] if said else [])


def test_labels_have_hints() -> None:
    marked = "char a; void main(void) { ‸goto loob; loop: a = 1; goto loop; }"
    said = "error c-jump: there is no label 'loob' in 'main' // did you mean 'loop'?"
    assert found_in(marked) == stated(marked, [said])


# conversions

GLOBALS = (
    "unsigned char a; signed char s; int i; unsigned int u; long l; unsigned long w; float f; bit t; "
    "char *p; "
    "const char *k; int *q; void *vp; struct st { unsigned x : 3; signed y : 3; int z; } o; "
    "int g(char x) { return x; } int (*fp)(char); void h(void) { } "
    "struct so *so;\n"
)


def conversion(value: object, kind: str, becomes: object) -> str:
    return f"c-conversion: {value} does not fit '{kind}' and becomes {becomes}"


LIMITS = [
    # variable, type, the least and the greatest constant without a warning, and what the next ones become
    ("a", "unsigned char", -128, 255, 127, 0),
    ("s", "signed char", -128, 127, 127, -128),
    ("i", "int", -32768, 32767, 32767, -32768),
    ("u", "unsigned int", -32768, 65535, 32767, 0),
]


@pytest.mark.parametrize(("variable", "kind", "low", "high", "below", "above"), LIMITS)
def test_a_constant_that_a_type_does_not_hold(
    variable: str, kind: str, low: int, high: int, below: int, above: int
) -> None:
    for value, becomes in ((low, None), (high, None), (low - 1, below), (high + 1, above)):
        mark, sign = "‸" if becomes is not None else "", "-" if value < 0 else ""
        marked = f"{GLOBALS}void main(void) {{ {variable} = {sign}{mark}{abs(value)}L; }}"
        said = [conversion(value, kind, becomes)] if mark else []
        assert found_in(marked) == stated(marked, said)


CONVERSIONS = [
    ("t = 2;", []), ("o.x = 7;", []),
    ("o.x = ‸8;", ["c-conversion: 8 does not fit a bit-field of 3 bits"]),
    ("o.y = -4;", []),
    ("o.y = -‸5;", ["c-conversion: -5 does not fit a bit-field of 3 bits"]),
    ("o.y = 7;", []),
    ("o.y = ‸8;", ["c-conversion: 8 does not fit a bit-field of 3 bits"]),
    ("a = ‸2.5;", [conversion("2.5", "unsigned char", 2)]),
    ("a = 255.0;", []),
    ("a = ‸256.0;", [conversion("256", "unsigned char", 0)]),
    ("s = ‸128.0;", [conversion("128", "signed char", -128)]),
    ("s = -128.0;", []),
    ("s = -‸129.0;", [conversion("-129", "signed char", 127)]),
    ("f = 65536;", []),
    ("f = ‸65537;", ["c-conversion: 65537 has more digits than 'float' and becomes 65536"]),
    ("f = 65535;", []),
    ("f = ‸1e-60;", ["c-conversion: 1e-60 is too small for 'float' and becomes 0"]),
    ("p = 0;", []),
    ("p = ‸1;", ["c-conversion: the assignment makes a pointer from the number 1 without a cast"]),
    ("p = ‸k;", ["error c-const: the assignment would drop const: 'const unsigned char *' may point to "
        "flash, 'unsigned char *' cannot // declare the pointer as a pointer to const"]),
    ("k = p;", []), ("vp = p; p = vp;", []),
    ("q = ‸p;", ["c-conversion: the assignment makes 'int *' from 'unsigned char *' without a cast"]),
    ("q = (int *)p;", []),
    ("i = ‸p;", ["c-conversion: the assignment makes 'int' from the pointer 'unsigned char *' without a "
        "cast"]),
    ("i = ‸g;", ["c-conversion: the assignment makes 'int' from the pointer 'int (*)(unsigned char)' "
        "without a cast // to call a function, write its name and parentheses"]),
    ("t = p;", []),
    ("p = ‸f;", ["error c-type: the assignment needs 'unsigned char *', not 'float'"]),
    ("f = ‸p;", ["error c-type: the assignment needs 'float', not 'unsigned char *'"]),
    ("o = ‸i;", ["error c-type: the assignment needs 'struct st', not 'int'"]),
    ("i = ‸o;", ["error c-type: the assignment needs 'int', not 'struct st'"]),
    ("p = (char *)255;", []),
    ("p = (char *)‸256;", ["error c-address: the address 0x100 does not fit 'unsigned char *' // it has "
        "1 byte"]),
    ("k = (const char *)65535;", []),
    ("k = (const char *)‸65536;", ["error c-address: the address 0x10000 does not fit 'const unsigned "
        "char *' // it has 2 bytes"]),
    ("p = (char *)-128;", []),
    ("p = (char *)-‸129;", ["error c-address: the address 0xFFFFFF7F does not fit 'unsigned char *' // "
        "it has 1 byte"]),
    ("p = (char *)0xFFFF;", []), ("p = (char *)0xFFFFFFFF;", []), ("p = (char *)0xFFFFFF;", []),
    ("k = (const char *)0xFFFFFF;", []), ("k = (const char *)-32768;", []),
    ("k = (const char *)-‸32769;", ["error c-address: the address 0xFFFF7FFF does not fit 'const unsigned "
        "char *' // it has 2 bytes"]),
    ("p = (char *)‸0xFFFFFE;", ["error c-address: the address 0xFFFFFE does not fit 'unsigned char *' // "
        "it has 1 byte"]),
    ("p = (char *)‸0xFFFFFFFE;", ["error c-address: the address 0xFFFFFFFE does not fit 'unsigned char *' "
        "// it has 1 byte"]),
    ("p = (char *)‸0xFFFE;", ["error c-address: the address 0xFFFE does not fit 'unsigned char *' // it "
        "has 1 byte"]),
    ("i = g(‸300);", [conversion(300, "unsigned char", 44)]),
    ("‸g();", ["error c-argument: 'g' takes 1 argument, 0 are given // it is declared at main.c:1:197"]),
    ("‸g(1, 2);", ["error c-argument: 'g' takes 1 argument, 2 are given // it is declared at main.c:1:197"]),
    ("g(‸o);", ["error c-type: argument 1 of 'g' needs 'unsigned char', not 'struct st'"]),
    ("fp(‸o);", ["error c-type: argument 1 of the function needs 'unsigned char', not 'struct st'"]),
    ("if (‸a < 0) i = 1;", ["c-comparison: this comparison is always false // the left side is 0 … 255, "
        "the right side 0 … 0"]),
    ("if (‸a >= 0) i = 1;", ["c-comparison: this comparison is always true // the left side is 0 … 255, "
        "the right side 0 … 0"]),
    ("if (‸a > 255) i = 1;", ["c-comparison: this comparison is always false // the left side is 0 … "
        "255, the right side 255 … 255"]),
    ("if (‸a <= 255) i = 1;", ["c-comparison: this comparison is always true // the left side is 0 … "
        "255, the right side 255 … 255"]),
    ("if (‸a == 256) i = 1;", ["c-comparison: this comparison is always false // the left side is 0 … "
        "255, the right side 256 … 256"]),
    ("if (‸a != -1) i = 1;", ["c-comparison: this comparison is always true // the left side is 0 … "
        "255, the right side -1 … -1"]),
    ("if (‸256 > a) i = 1;", ["c-comparison: this comparison is always true // the left side is 256 … "
        "256, the right side 0 … 255"]),
    ("if (‸255 < a) i = 1;", ["c-comparison: this comparison is always false // the left side is 255 … "
        "255, the right side 0 … 255"]),
    ("if (a < 1) i = 1;", []), ("if (a > 254) i = 1;", []), ("if (a <= 254) i = 1;", []),
    ("if (a >= 1) i = 1;", []), ("if (a == 255) i = 1;", []), ("if (a != 0) i = 1;", []),
    ("if (‸i < u) a = 1;", ["c-sign-compare: this compares a signed and an unsigned number: a negative "
        "one counts as large and positive // declare both in the same way, or cast one"]),
    ("if (‸u == i) a = 1;", ["c-sign-compare: this compares a signed and an unsigned number: a negative "
        "one counts as large and positive // declare both in the same way, or cast one"]),
    ("if (a < u) i = 1;", []), ("if (i < (int)u) a = 1;", []), ("if (u < 5) a = 1;", []),
    ("if (l < u) a = 1;", []),
    ("i = ‸32767 + 1;", ["c-overflow: 32767 + 1 is 32768, which does not fit 'int', and becomes -32768 "
        "// append L to one of them, to compute in 32 bits"]),
    ("i = 32766 + 1;", []),
    ("i = -‸32767 - 2;", ["c-overflow: -32767 - 2 is -32769, which does not fit 'int', and becomes "
        "32767 // append L to one of them, to compute in 32 bits"]),
    ("i = -32767 - 1;", []),
    ("i = ‸256 * 128;", ["c-overflow: 256 * 128 is 32768, which does not fit 'int', and becomes -32768 "
        "// append L to one of them, to compute in 32 bits"]),
    ("u = 256u * 256;", []), ("l = 256L * 128;", []),
    ("i = ‸a << 16;", ["c-shift: shift by 16, but 'int' has only 16 bits"]),
    ("i = a << 15;", []),
    ("l = ‸l >> 32;", ["c-shift: shift by 32, but 'long' has only 32 bits"]),
    ("i = ‸a >> -1;", ["c-shift: shift by -1, but 'int' has only 16 bits"]),
    ("‸a <<= 16;", ["c-shift: shift by 16, but 'int' has only 16 bits"]),  # char becomes int first
    ("a >>= 15;", []), ("a <<= 0;", []), ("i = a << 0;", []),
    ("‸l <<= 32;", ["c-shift: shift by 32, but 'long' has only 32 bits"]),
    ("i = a / ‸0;", ["error c-division-by-zero: division by zero"]),
    ("i = a % ‸0;", ["error c-division-by-zero: division by zero"]),
    ("i /= ‸0;", ["error c-division-by-zero: division by zero"]),
    ("a %= ‸0;", ["error c-division-by-zero: division by zero"]),
    ("f /= 0;", []),
    ("i = ‸f % 2;", ["error c-type: an integer is needed here, not 'float'"]),
    ("‸f %= 2;", ["error c-type: '%=' cannot be applied to 'float'"]),
    ("‸a = a;", ["c-no-effect: 'a' is assigned to itself"]),
    ("i = ‸a ? h() : 1;", ["error c-type: the two values of '?:' have the types 'void' and 'int'"]),
    ("i = ‸a ? 1 : h();", ["error c-type: the two values of '?:' have the types 'int' and 'void'"]),
    ("a ? h() : h();", []), ("o.x = o.y;", []),
    ("‸5 = a;", ["error c-lvalue: this cannot be assigned to"]),
    ("p = &‸t;", ["error c-lvalue: a bit has no address"]),
    ("i = *‸a;", ["error c-type: '*' needs a pointer, not 'unsigned char'"]),
    ("i = ‸a[1];", ["error c-type: 'unsigned char' cannot be indexed"]),
    ("i = a.‸b;", ["error c-undeclared: 'unsigned char' has no members"]),
    ("i = o.‸zz;", ["error c-undeclared: 'struct st' has no member 'zz' // did you mean 'z'?"]),
    ("i = ‸o->z;", ["error c-type: '->' needs a pointer to a structure, not 'struct st'"]),
    ("i = ‸b;", ["error c-undeclared: 'b' is not declared"]),
    ("i = ‸PORTC;", ["error c-undeclared: 'PORTC' is not declared // did you mean 'PORTB'?"]),
    ("‸gg(1);", ["error c-undeclared: the function 'gg' is not declared // did you mean 'g'?"]),
    ("‸__delay_uss(1);", ["error c-undeclared: the function '__delay_uss' is not declared // did you "
        "mean '__delay_us'?"]),
    ("i = ‸strlen(p);", ["error c-undeclared: the function 'strlen' is not declared // did you forget "
        "#include <string.h>?"]),
    ("f = ‸sin(f);", ["error c-unsupported: the library has no 'sin' // of <math.h> it has fabs, sqrt, "
        "floor and ceil"]),
    ("f = ‸cosf(f);", ["error c-unsupported: the library has no 'cosf' // of <math.h> it has fabs, "
        "sqrt, floor and ceil"]),
    ("‸a();", ["error c-type: 'a' is not a function"]),
    ("i = ‸so->x;", ["error c-undefined: 'struct so' is not defined"]),
    ("i = ‸sizeof(struct so);", ["error c-undefined: 'struct so' is not defined"]),
    ("*‸so = *so;", ["error c-undefined: 'struct so' is not defined"]),
    ("*‸k = 1;", ["error c-const: this is const and cannot be changed"]),
    ("‸k[2] = 1;", ["error c-const: this is const and cannot be changed"]),
    ("if (‸g) a = 1;", ["c-comparison: this address is always true // call the function: write its name "
        "and parentheses"]),
    ("i = ‸'\\q';", ["c-number: unknown escape '\\q'"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), CONVERSIONS)
def test_a_conversion_says_what_it_changes(text: str, said: list[str]) -> None:
    marked = f"{GLOBALS}void main(void) {{ {text} }}"
    assert found_in(marked) == stated(marked, said)


def test_in_c2c_constants_may_have_16_bits_without_a_sign() -> None:
    head = "unsigned char a; int i; signed int n; uint32_t w;\n"
    for text, said in (
        ("n = 255 * 257;", []),
        ("n = 32767 + 32767;", []),
        (
            "n = ‸256 * 256;",
            [
                "c-overflow: 256 * 256 is 65536, which does not fit 'signed int', and becomes 0 // append L "
                "to one of them, to compute in 32 bits"
            ],
        ),
        ("a = -1;", []),
        ("i = -‸1;", ["c-conversion: -1 does not fit 'int' and becomes 65535"]),
        ("i = 255 * 257;", []),
        ("i = 255 * 257 - 1;", []),
        ("a = ‸200 * 200;", ["c-conversion: 40000 does not fit 'unsigned char' and becomes 64"]),
        ("w = ‸255 * 257;", ["c-conversion: 65535 does not fit 'signed int' and becomes 4294967295"]),
    ):
        marked = f"{head}void main(void) {{ {text} }}"
        assert found_in(marked, "c2c") == stated(marked, said)


# where diagnostics are collected


def test_the_reporter_stops_at_its_limit_of_errors() -> None:
    reporter = Reporter()
    for number in range(1, ERRORS):
        reporter.error("c-type", f"error {number}", Location("a.c", number))
    assert reporter.errors == ERRORS - 1
    with pytest.raises(InputError) as caught:
        reporter.error("c-type", "the last", Location("a.c", 1))
    assert len(caught.value.diagnostics) == ERRORS == 50


def test_diagnostics_come_in_the_order_of_the_sources() -> None:
    reporter = Reporter(frozenset(("c-unused",)))
    reporter.add_source("b.c", "  one\n\ttwo")
    reporter.add_source("a.c", "x")
    assert (reporter.lines("b.c"), reporter.lines("c.c")) == (["  one", "\ttwo"], [])
    reporter.warn("c-type", "4", Location("a.c", 1))
    reporter.warn("c-type", "3", Location("b.c", 2, 9))
    reporter.warn("c-type", "2", Location("b.c", 2))
    reporter.warn("c-type", "1", Location("b.c", 1))
    reporter.warn("c-type", "1", Location("b.c", 1))
    reporter.warn("c-type", "5", Location("c.c", 1))
    reporter.warn("c-type", "6", Location("c.c", 3))
    reporter.warn("c-unused", "unwanted", Location("b.c", 1))
    reporter.warn("c-type", "the library's", Location("<math.h>", 1))
    reporter.stop_on_error()
    assert reporter.errors == 0
    assert [(each.message, str(each.location)) for each in reporter.ordered()] == [
        ("1", "b.c:1:3"), ("2", "b.c:2:2"), ("3", "b.c:2:9"),
        ("4", "a.c:1:1"), ("5", "c.c:1"), ("6", "c.c:3"),
    ]  # fmt: skip
    assert reporter.source_lines() == {("b.c", 1): "  one", ("b.c", 2): "\ttwo", ("a.c", 1): "x"}
    fatal = reporter.fatal("c-jump", "no", Location("a.c", 1), "do not")
    assert isinstance(fatal, Fatal)
    with pytest.raises(InputError) as caught:
        reporter.stop_on_error()
    assert Diagnostic("error", "c-jump", "no", Location("a.c", 1, 1), "do not") in caught.value.diagnostics
    reporter.too_deep(Location("a.c", 1, 7))
    assert [line_of(each) for each in reporter.ordered() if each.code == "nested-too-deeply"] == [
        "error nested-too-deeply: something in the program is nested too deeply // "
        "look for parentheses or braces that are never closed, or divide the expression"
    ]
    assert [is_own_file(Location(file)) for file in ("<math.h>", "math.h", None)] == [True, False, False]


def test_a_place_behind_the_end_of_a_file_has_no_line() -> None:
    reporter = Reporter()
    reporter.add_source("a.c", "one\ntwo")
    for line in (2, 3):
        reporter.warn("c-type", "x", Location("a.c", line))
    assert [each.location.column for each in reporter.ordered() if each.location] == [1, None]


# the compilation as a whole


def compiled(text: str = "char x; void main(void) { x = 1; while (1) ; }", **options: object) -> Compilation:
    return compile_sources([Source(text)], Options(**options))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("dialect", "xc9", "unknown dialect 'xc9'|did you mean 'xc8'?"),
        ("optimise", "spead", "unknown level of optimisation 'spead'|did you mean 'speed'?"),
        ("dump_ir", "codegem", "unknown pass 'codegem'|did you mean 'codegen'?"),
        ("float_bits", 16, "'float' has 24 or 32 bits, not 16|None"),
    ],
)
def test_an_option_that_is_not_known(option: str, value: object, said: str) -> None:
    with pytest.raises(InputError) as caught:
        compiled(**{option: value})
    (found,) = caught.value.diagnostics
    assert (found.code, f"{found.message}|{found.hint}") == ("bad-option", said)


def test_a_compilation_needs_a_source() -> None:
    with pytest.raises(InputError) as caught:
        compile_sources([])
    assert [(each.code, each.message) for each in caught.value.diagnostics] == [
        ("missing-option", "there is no source file to compile")
    ]


def test_a_compilation_says_how_large_the_program_is() -> None:
    found = compiled()
    assert found.words == found.image.words
    assert found.ram_bytes == 1
    assert repr(found) == f"<Compilation: {found.words} words, 1 byte of RAM, 0 warnings>"
    assert (found.clock, found.device.name, found.ir) == (None, "PIC16F84A", "")
    assert compiled(clock_hz=8_000_000).clock is not None
    assert all(count > 0 for count in found.saved.values())


def test_the_faster_chip_is_taken_only_where_the_clock_asks_for_it() -> None:
    slow, fast = device("PIC16F84"), device("PIC16F84A")
    for hz, taken in ((10_000_000, slow), (10_000_001, fast)):
        assert compiled(clock_hz=hz, device=slow, faster_device=fast).device is taken
    with pytest.raises(InputError, match="too fast: PIC16F84 runs"):
        compiled(clock_hz=10_000_001, device=slow)


def test_the_intermediate_form_is_kept_after_one_pass() -> None:
    text = "char x; void f(void) { x = 2; x = 3; } void main(void) { f(); f(); while (1) ; }"
    for level in ("none", "speed"):
        first = compiled(text, dump_ir="codegen", optimise=level).ir
        assert "MOVLW" in first
        assert first.count("CALL") == 2
    assert compiled(text, dump_ir="dead-code", optimise="none").ir == ""
    assert compiled(text, dump_ir="delays").ir != compiled(text, dump_ir="codegen").ir


def test_what_nothing_calls_is_not_in_the_image() -> None:
    small = compiled()
    assert (
        compiled("char x; void f(void) { x = 9; } void main(void) { x = 1; while (1) ; }").words
        == small.words
    )


def test_a_variable_that_the_interrupt_changes_is_read_each_time() -> None:
    body = "void main(void) { INTCON = 0x88; while (x) ; PORTB = 1; }"
    plain = compiled(f"char x; void interrupt(void) {{ RBIF = 0; }}\n{body}")
    shared = compiled(f"char x; void interrupt(void) {{ RBIF = 0; x = 1; }}\n{body}")
    assert shared.words != plain.words


def test_an_error_behind_a_jump_is_told_once_from_what_is_never_reached() -> None:
    marked = "char a; void main(void) { return; ‸‸x = 1; a = 2; }"
    said = ["c-unreachable: this is never reached", "error c-undeclared: 'x' is not declared"]
    assert sorted(found_in(marked)) == sorted(stated(marked, said))
    marked = "char a; void main(void) { goto here; here: a = ‸x; a = 2; }"
    assert found_in(marked) == stated(marked, ["error c-undeclared: 'x' is not declared"])
