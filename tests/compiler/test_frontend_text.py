"""From the text to the parser's tokens, with every place: assembly, macros, numbers, extensions."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import pytest

import servogen.compiler.limits as limits
from servogen.compiler.diagnostics import Fatal, Reporter
from servogen.compiler.frontend.assembly import (
    AsmBlock,
    assembler_number,
    binary_constants,
    plain_numbers,
    replace_macros,
    rewrite,
)
from servogen.compiler.frontend.extensions import BitAddress, Position, Rewritten, rewrite_tokens
from servogen.compiler.frontend.preprocessor import Preprocessed, preprocess
from servogen.errors import InputError, Location
from tests.compiler.marked import CARET, line_of

FILE = "m.c"


class Read:
    """What the first stages make of a text."""

    def __init__(
        self, text: str, files: Mapping[str, str] | None = None, defines: Mapping[str, str] | None = None
    ) -> None:
        self.reporter = Reporter()
        self.blocks: list[AsmBlock] = []
        included = files or {}
        self.preprocessed: Preprocessed = preprocess(
            text,
            FILE,
            defines=defines or {},
            headers={"own.h": "int own;\n"},
            resolver=lambda name, _: (name, included[name]) if name in included else None,
            reporter=self.reporter,
            blocks=self.blocks,
        )

    @property
    def tokens(self) -> str:
        return " ".join(token.text for token in self.preprocessed.tokens)

    @property
    def places(self) -> list[tuple[int | None, int | None]]:
        return [(token.place.line, token.place.column) for token in self.preprocessed.tokens]

    @property
    def said(self) -> list[str]:
        return [f"{each.location}: {line_of(each)}" for each in self.reporter.ordered()]

    def rewritten(self) -> Rewritten:
        return rewrite_tokens(self.preprocessed.tokens, self.blocks, self.reporter, 0)

    def plain(self) -> str:
        return " ".join(token.text for token in self.rewritten().tokens)


# tokens and their places

MARKED = [
    "‸int ‸a‸;", "‸a ‸+‸b‸;\n\n  ‸c", "\t‸a ‸b", "‸x ‸^=‸ ‸1.5e-3 ‸+ ‸.5 ‸- ‸p‸.‸7",
    "‸12UL‸+‸0x1F‸-‸1e+3‸+‸1E5", "‸0x1p-3‸+‸0x1e‸+‸3", "‸return ‸.5‸;", "‸a‸[‸0‸]‸.‸7 ‸f‸(‸)‸.‸3",
    "‸case ‸.5 ‸else ‸.5", "‸a /* x */ ‸b // c\n‸d", "/* one\ntwo */ ‸x", "‸'a' ‸\"b c\"‸;",
    "‸a ‸<<= ‸b ‸>> ‸c ‸-> ‸d ‸++",
]  # fmt: skip


@pytest.mark.parametrize("marked", MARKED)
def test_each_token_has_its_line_and_column(marked: str) -> None:
    places, before = [], ""
    for part in marked.replace("‸ ‸", " ‸").split(CARET)[:-1]:
        before += part
        places.append((before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1))
    read = Read(marked.replace(CARET, ""))
    assert read.places == places
    assert read.said == []


def test_a_token_of_a_macro_is_where_the_name_of_the_macro_is() -> None:
    read = Read("#define N 5\n#define TWICE(x) x + x\nint a = N + N;\nint b = TWICE(3) + N;")
    assert read.tokens == "int a = 5 + 5 ; int b = 3 + 3 + 5 ;"
    assert read.places[3:7] == [(3, 9), (3, 11), (3, 13), (3, 14)]
    assert read.places[10] == (4, 9)
    assert read.places[13:] == [(4, 18), (4, 20), (4, 21)]
    assert Read("#define N 5\na = N+N;").places == [(2, 1), (2, 3), (2, 5), (2, 6), (2, 7), (2, 8)]


@pytest.mark.parametrize(
    ("text", "tokens"),
    [
        ("#define F 1\n2.5F 1.e3F F", "2.5F 1.e3F 1"),
        ("#define U 7\n#define L 8\n10U 10UL 10ULL", "10U 10UL 10ULL"),
        ("#define b1 3\n#define x2 4\n0b1 0x2 0x1b1", "0x1 0x2 0x1b1"),
        ("#define HALF(f) f * 0.5f\nHALF(3)", "3 * 0.5f"),
        ("#define HEX(x) 0x##x\nHEX(1F)", "0x1F"),
        ("#define BIN(b) 0b##b\nBIN(101)", "0x5"),
        ("#define S(x) #x\nS(0b101)", '"0b101"'),
        ("#define N 5\nN.3 0x30.7", "5 . 3 0x30.7"),
        ("0b101 0B1010u 101b 11111111B 0b12 a0b1 0x10b", "0x5 0xau 0x5 0xff 0b12 a0b1 0x10b"),
    ],
)
def test_a_number_is_one_token_of_the_preprocessor(text: str, tokens: str) -> None:
    """ISO C 6.4.8: no part of it is a name that a macro or a parameter could replace."""
    read = Read(text)
    assert (read.tokens, read.said) == (tokens, [])


@pytest.mark.parametrize(
    ("text", "tokens"),
    [
        ("#define M a ## b x ## 1\nM", "ab x1"),
        ("#define V(...) #__VA_ARGS__\nV( a , b )", '"a , b"'),
        (
            "#define L(f, ...) f(0, ## __VA_ARGS__)\nL(g) L(g,) L(g, 1, 2)",
            "g ( 0 ) g ( 0 , ) g ( 0 , 1 , 2 )",
        ),
        ("#define E(...) f(0, ## __VA_ARGS__)\nE() E(1)", "f ( 0 ) f ( 0 , 1 )"),
        ("#define J(a, b) a ## b\nJ(,1) J(x,) J(,) J(x y, 1 z) ;", "1 x x y1 z ;"),
        ("#define X 5\n#define J(a) a ## 1 a #a\nJ(X)", 'X1 5 "X"'),
        ("#define f(x) f(x) + x\nf(f(1))", "f ( f ( 1 ) + 1 ) + f ( 1 ) + 1"),
        ("#define A B(\n#define B(x) [x]\nA 1) B", "[ 1 ] B"),
        ("#define F() 1\n#define G F\nG() F\n()", "1 1"),
        ("#define N __LINE__\nN\nN __COUNTER__ __COUNTER__", "2 3 0 1"),
    ],
)
def test_what_a_macro_is_replaced_with(text: str, tokens: str) -> None:
    """ISO C 6.10.3, and GNU's comma before arguments that are left out."""
    read = Read(text)
    assert (read.tokens, read.said) == (tokens, [])


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("1 / 0", "it divides by zero"), ("1 +", "an operand is missing"), ("(1", "')' is missing"),
        ("X(1", "')' is missing"), ("1 ? 2", "':' is missing"), ("1 2", "'2' is not expected there"),
        ("'ab'", "''ab'' is no integer"), ("'\\q'", "'\\q' is no character"), ("1.5", "'1.5' is no integer"),
        ("0x10000000000000000", "'0x10000000000000000' has more than 64 bits"),
    ],
)  # fmt: skip
def test_a_condition_that_has_no_value(condition: str, said: str) -> None:
    assert Read(f"#if {condition}\n#endif").said == [
        f"m.c:1:1: error c-preprocessor: preprocessor: the expression of #if: {said}"
    ]


def test_the_macros_that_a_file_leaves() -> None:
    read = Read("#define A 5 + 1\n#define F(x) x\n#define B\n#define C 1\n#undef C\n", defines={"D": "2"})
    left = {name: value for name, value in read.preprocessed.macros.items() if not name.startswith("__")}
    assert left == {"A": ("5 + 1", Location(FILE, 1)), "B": ("", Location(FILE, 3))}
    assert Read("#if D == 2\nyes\n#endif", defines={"D": "2"}).tokens == "yes"


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("1LL << 40 > 0", True), ("1 << 63 == 0", False), ("(1 << 64) == 0", True), ("(1 << 0) == 1", True),
        ("(1 << 1000000000) == 0", True), ("10ULL / 3 == 3", True), ("2l == 2", True), ("3UL > 2u", True),
        ("0b101 == 5 && 0B11u == 3 && 101b == 5", True),
        ("0u - 1 > 0", True), ("defined X", False), ("-(10u == 10) < 0", True), ("(1u > 0) - 2 < 0", True),
        ("-7 / 2 == -3 && -7 % 2 == -1 && 7 / -2 == -3", True),
        ("(1 ? -1 : 0u) > 0", True),
        ("0x7fffffffffffffff / 3 == 0x2aaaaaaaaaaaaaaa", True),
        ("0 && 1 / 0", False), ("1 || 1 % 0", True), ("1 ? 2 : 1 / 0", True),
        ("1 + 2 * 3 == 7 && (1 | 6 ^ 2 & 3) == 5 && 1 << 2 < 5", True),
        ("'A' == 65 && '\\n' == 10 && '\\x41' == '\\101'", True),
        ("!X + ~0 == 0 && X(1, (2)) == 0", True),
    ],
)  # fmt: skip
def test_the_condition_of_an_if(condition: str, holds: bool) -> None:
    read = Read(f"#if {condition}\nyes\n#else\nno\n#endif")
    assert (read.tokens, read.said) == ("yes" if holds else "no", [])


def test_pragmas_are_kept_with_their_macros_expanded() -> None:
    read = Read("#define F 4000000\n\n#pragma CLOCK_FREQ F\n#pragma DATA 1, 2\n")
    assert [(pragma.words, pragma.place.line) for pragma in read.preprocessed.pragmas] == [
        ("CLOCK_FREQ 4000000", 3),
        ("DATA 1, 2", 4),
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("\n#error a b", "m.c:2:1: error c-user-message: #error a b"),
        ("\n  #warning a b", "m.c:2:3: c-user-message: #warning a b"),
        ("#include x", "m.c:1:1: error c-preprocessor: #include needs a file name in <…> or quotes"),
        ("\n#line 3", "m.c:2:1: error c-preprocessor: #line is not supported: messages name the lines "
            "of the file itself"),
        ("#nonsense", "m.c:1:1: error c-preprocessor: unknown preprocessor directive #nonsense"),
        ("int a;\n#if\n#endif", "m.c:2:1: error c-preprocessor: preprocessor: Empty expression"),
        ("#define", "m.c:1:1: error c-preprocessor: malformed preprocessor directive"),
        ("#define F(a) a\n\nF(1, 2)", "m.c:3:1: error c-preprocessor: preprocessor: Macro F requires 1 "
            "arguments but was passed 2"),
        ("a /* b", "m.c:1:1: error c-syntax: the comment is not closed // write '*/' where it ends"),
        ("a\n\n  /* b\n /* c */", "m.c:4:2: c-comment: a comment begins inside a comment // the first "
            "'*/' ends both"),
        ("a // b\\\nc", "m.c:1:1: c-comment: '\\' at its end continues this comment on the next line"),
    ],
)  # fmt: skip
def test_what_the_first_stage_reports(text: str, said: str) -> None:
    assert Read(text).said == [said]


@pytest.mark.parametrize("text", ["// a /* b", "/**/", "/* a // b */", "'\"' /* */ '\"'", '"/*" a', "a / *b"])
def test_comments_that_are_in_order(text: str) -> None:
    assert Read(text).said == []


def test_a_file_that_is_not_there() -> None:
    (said,) = Read('\n#include "no.h"').said
    assert said.startswith(
        "m.c:2:1: error c-include: include file 'no.h' was not found // the compiler's own headers: "
    )
    assert ", own.h, " in said
    assert "string.h" in said


def test_a_refusal_of_the_resolver_is_passed_on() -> None:
    reporter = Reporter()

    def refuse(name: str, file: str) -> tuple[str, str]:
        raise InputError("bad", f"is too large, from {file}", hint="make it smaller")

    preprocess('#include "a.h"', FILE, defines={}, headers={}, resolver=refuse, reporter=reporter, blocks=[])
    assert [line_of(each) for each in reporter.ordered()] == [
        "error c-include: include file 'a.h' is too large, from m.c // make it smaller"
    ]


def test_included_files_keep_their_places() -> None:
    read = Read('#include <own.h>\n#include "a.h"\nlast', {"a.h": "#pragma once\n  one\n"})
    assert read.tokens == "int own ; one last"
    assert [token.place for token in read.preprocessed.tokens][-2:] == [
        Location("a.h", 2, 3),
        Location(FILE, 3, 1),
    ]
    again = Read('#include "a.h"\n#include "a.h"\nlast', {"a.h": "#pragma once\none\n"})
    assert again.tokens == "one last"


# limits, each reached and passed by one


def test_includes_are_nested_up_to_a_limit() -> None:
    """Level 1 is what the source file itself includes."""
    said = "20.h:1:1: error c-include: #include is nested more than 20 levels deep"
    for deepest in (20, 21):
        files = {f"{depth}.h": f'#include "{depth + 1}.h"\n' for depth in range(1, deepest)}
        read = Read('#include "1.h"', files | {f"{deepest}.h": "end\n"})
        assert (read.tokens, read.said) == (("end", []) if deepest == 20 else ("", [said]))
    beside = Read('#include "a.h"\n' * 30, {"a.h": "a\n"})
    assert (beside.tokens, beside.said) == (" ".join("a" * 30), [])


LIMITS = [
    ("INCLUDES", 2, '#include "a.h"\n' * 2, '#include "a.h"\n' * 3, "m.c:3:1: error c-include: more "
        "than 2 files are included"),
    ("TOKENS", 5, "a b c d e", "a b c d e f", "m.c:1:11: error program-too-large: the program has more "
        "than 5 tokens"),
    ("SOURCE_CHARACTERS", 9, "a = b + 1", "a = b + 10",
        "m.c: error program-too-large: 'm.c' has 10 characters, a source file has at most 9"),
    ("ALL_CHARACTERS", 19, '#include "a.h"\n1234', '#include "a.h"\n12345',
        "m.c: error program-too-large: the source files have more than 19 characters together"),
    ("ASSEMBLY_LINES", 2, "asm { nop\n nop }", "asm { nop\n nop\n nop }",
        "m.c:3:2: error program-too-large: the program has more than 2 lines of assembly"),
    ("EXPANDED_CHARACTERS", 6, "#define A 123456\nA", "#define A 1234567\nA",
        "m.c:2:1: error program-too-large: the macros expand to more than 6 characters"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "most", "fits", "exceeds", "said"), LIMITS)
def test_a_program_may_be_as_large_as_the_limit_and_no_larger(
    name: str, most: int, fits: str, exceeds: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, name, most)
    files = {"a.h": ""}
    assert Read(fits, files).said == []
    reporter = Reporter()
    with pytest.raises(Fatal):
        preprocess(
            exceeds,
            FILE,
            defines={},
            headers={},
            resolver=lambda name, _: (name, ""),
            reporter=reporter,
            blocks=[],
        )
    assert [f"{each.location}: {line_of(each)}" for each in reporter.ordered()] == [said]


def test_long_messages_of_the_preprocessor_are_cut() -> None:
    (said,) = Read(f'#include "a.h"\n#if {"(" * 300}\n#endif', {"a.h": ""}).said
    assert len(said) < 300


# assembly before the parser


@pytest.mark.parametrize(
    ("text", "out", "lines"),
    [
        ("#asm\n movlw 1\n\n nop ; x\n#endasm\ny", "M(0);\n\n\n\n\ny", [(2, " movlw 1"), (4, " nop ; x")]),
        ("#asm\n#endasm\ny", "M(0);\n\ny", []),
        ("#asm nop #endasm\ny", "M(0);\ny", []),
        ("a\nasm movlw 1 ; c\ny", "a\nM(0);\ny", [(2, " movlw 1 ; c")]),
        ("asm nop", "M(0);", [(1, " nop")]),
        ("asm { nop\n\n clrw }\ny", "M(0);\n\n\ny", [(1, " nop"), (3, " clrw ")]),
        ("asm\n{ nop }\ny", "M(0);\n\ny", [(2, " nop ")]),
        ("asm { nop", "M(0);", [(1, " nop")]),
        ("_asm nop\n clrw _endasm; y", "M(0);\n y", [(1, " nop"), (2, " clrw ")]),
        ("__asm\n nop\n __endasm;\ny", "M(0);\n\n\ny", [(2, " nop")]),
        ("_asm ; only a comment\n _endasm y", "M(0);\ny", []),
        ("_asm // only\n nop _endasm", "M(0);\n", [(2, " nop ")]),
        ('asm("nop"); y', 'asm("nop"); y', []),
        ('asm volatile ("nop"); y', 'asm volatile ("nop"); y', []),
        ("nop asmx", "nop asmx", []),
    ],
)  # fmt: skip
def test_blocks_of_assembly_become_markers_and_lines_stay(
    text: str, out: str, lines: list[tuple[int, str]]
) -> None:
    blocks: list[AsmBlock] = []
    reporter = Reporter()
    assert rewrite(text, FILE, blocks, reporter) == out.replace("M(", "__servogen_asm(")
    assert [line for block in blocks for line in block.lines] == lines
    assert reporter.ordered() == ()


def test_each_block_has_a_marker_of_its_own() -> None:
    blocks = [AsmBlock("other.c", ())]
    assert (
        rewrite("asm nop\n\nasm clrw\n", FILE, blocks, Reporter())
        == "__servogen_asm(1);\n\n__servogen_asm(2);\n"
    )
    assert blocks[1:] == [AsmBlock(FILE, ((1, " nop"),)), AsmBlock(FILE, ((3, " clrw"),))]


MACROS = {
    "N": "5", "LED": "RB3", "PORT": "PORTB", "OCT": "017", "TEXT": "a b", "W": "9", "BOTH": "PORTB,3",
    "loop": "7", "RB0": "1",
}  # fmt: skip


@pytest.mark.parametrize(
    ("line", "out"),
    [
        (" movlw N", " movlw 5"), ("here: movlw N ; N", "here: movlw 5 ; N"),
        (" movlw N+N // N", " movlw 5+5 // N"), (" bsf PORT,N", " bsf PORTB,5"),
        (" bsf BOTH", " bsf PORTB,3"), (" bsf LED", " bsf RB3"), (" movlw OCT", " movlw OCT"),
        (" movlw TEXT", " movlw TEXT"), (" movf N,W", " movf 5,W"), (" movf RB0,w", " movf RB0,w"),
        (" goto loop", " goto loop"), (" call loop", " call loop"), (" movlw 'N'", " movlw 'N'"),
        (" movlw other", " movlw other"), (" movlw .N", " movlw .N"), ("N", "N"),
    ],
)  # fmt: skip
def test_macros_in_the_operands_of_assembly(line: str, out: str) -> None:
    assert replace_macros(line, MACROS.get) == out


def test_macros_are_expanded_where_the_assembly_stands() -> None:
    read = Read(
        '#define N 5\nasm movlw N\n#undef N\n#define N 6UL\nasm movlw N\nasm("movlw N\\n movwf '
        '0x20");\nasm(N);'
    )
    assert [block.lines for block in read.blocks[2:]] == [((2, " movlw 5"),), ((5, " movlw 6"),)]
    assert read.tokens.endswith('asm ( "movlw 6\\n movwf 0x20" ) ; asm ( 6UL ) ;')
    assert read.tokens.startswith("__servogen_asm ( 2 ) ; __servogen_asm ( 3 ) ;")


def test_numbers_in_assembly() -> None:
    assert plain_numbers("5U + 0x1FUL - x1L + 7") == "5 + 0x1F - x1L + 7"
    assert plain_numbers("0b101U + 11b + B1") == "5 + 3 + B1"
    assert binary_constants("0b101 + 0B11 + a0b1") == "B'101' + B'11' + a0b1"
    numbers = {
        "(1500 - 14) / 1000 + 1": 2, "0b101": 5, "0x1F": 31, "10": 10, "H'10'": 16, "x": None, "": None,
        "1 +": None,
    }  # fmt: skip
    assert {text: assembler_number(text) for text in numbers} == numbers


# the extensions of the dialects

PLAIN = [
    ("char a @ 0x20 = 1, b;", "char a = 1 , b ;"),
    ("char a[3] @ 0x20;", "char a [ 3 ] ;"),
    ("__at(0x20) char a; __at 5 char b;", "char a ; char b ;"),
    ("interrupt void f(void) { }", "void f ( void ) { }"),
    ("void __interrupt() f(void) { }", "void f ( void ) { }"),
    ("void f(void) __interrupt 0 { }", "void f ( void ) { }"),
    ("void f(void) __interrupt(0) { }", "void f ( void ) { }"),
    ("void interrupt(void) { }", "void interrupt ( void ) { }"),
    ("void f(void) { int interrupt = 1; }", "void f ( void ) { int interrupt = 1 ; }"),
    ("__code char a; rom int b = 1;", "const char a ; const int b = 1 ;"),
    ("rom char *s = {1}; rom unsigned char *t;", "const char s [ ] = { 1 } ; const unsigned char * t ;"),
    ("static rom unsigned char *s = x;", "static const unsigned char s [ ] = x ;"),
    ("int rom; int rom = 1; f(rom);", "int rom ; int rom = 1 ; f ( rom ) ;"),
    ("__sfr x; __sbit y;", "volatile unsigned char x ; bit y ;"),
    ("__eeprom char a = 1; eeprom = 2;", "__eeprom char a = 1 ; eeprom = 2 ;"),
    ("eeprom char a; char *eeprom b;", "__eeprom char a ; char * __eeprom b ;"),
    ("void f(void) __naked { }", "void f ( void ) { }"),
    ("near char a; persistent int b; __xdata int c;", "char a ; int b ; int c ;"),
    ("char near *a, *far b; far int c;", "char * a , * b ; int c ;"),
    ("void f(int) reentrant { }", "void f ( int ) { }"),
    *[(same, same) for same in ("void f ( void ) { near = far + 1 ; far ++ ; return far * 2 ; }",
        "int f ( char far , int rom ) ;", "struct near { char far ; int eeprom : 2 ; } near ;",
        "enum { persistent , reentrant } ; int interrupt = 1 ;",
        "int f ( void ) { return rom - eeprom [ 1 ] ; }")],
    ("int a __attribute__((packed)); __using(1) x; __using = 1;", "int a ; x ; __using = 1 ;"),
    ("f(int a, ...);", "f ( int a , ... ) ;"),
    ("p.7 = q.12 + r.x + s.100;", "p . B7 = q . B12 + r . x + s . 100 ;"),
    ("void f(void) { __critical { a; } }", "void f ( void ) { L1 : { a ; } }"),
    ("void f(void) __critical { a; { } }", "void f ( void ) { L1 : { a ; { } } }"),
    ("void f(void) __critical;", "void f ( void ) ;"),
    ("__CONFIG(3); __CONFIG(4)", "enum { C1 = ( 3 ) } ; enum { C2 = ( 4 ) } ;"),
    ("void f(void) { __CONFIG(3); }", "void f ( void ) { ; } enum { C1 = ( 3 ) } ;"),
    ("__IDLOC(1aF);", "enum { I1 = 0x1aF } ;"),
    ("__EEPROM_DATA(1, 2);", "const unsigned char E1 [ ] = { 1 , 2 } ;"),
    ('void f(void) { asm("nop"); }', "void f ( void ) { __servogen_asm ( 0 ) ; }"),
    ('void f(void) { asm volatile ("a" "b") }', "void f ( void ) { __servogen_asm ( 0 ) ; }"),
    ('asm("__config 1"); int a;', "int a ;"), ("__CONFIG = 3;", "__CONFIG = 3 ;"),
]  # fmt: skip
NAMES = {
    "B": "__servogen_bit",
    "L": "__servogen_critical",
    "C": "__servogen_config",
    "I": "__servogen_id",
    "E": "__servogen_eeprom",
}


def generated(word: str) -> str:
    return NAMES[word[0]] + word[1:] if word[0] in NAMES and word[1:].isdigit() else word


@pytest.mark.parametrize(("text", "out"), PLAIN)
def test_an_extension_becomes_plain_c(text: str, out: str) -> None:
    assert Read(text).plain() == " ".join(generated(word) for word in out.split())


@pytest.mark.parametrize(
    ("marked", "addresses"),
    [
        ("char ‸a @ 0x20;", [0x20]),
        ("char ‸a @ 0x20 = 1, ‸b @ 0x21;", [0x20, 0x21]),
        ("char ‸a[2][3] @ (0x20 + 4);", [0x24]), ("char ‸a @ 017;", [15]), ("char ‸a @ 0x20UL;", [0x20]),
        ("__at(0x20) char ‸a;", [0x20]), ("__at 0x20 char ‸a[3], b;", [0x20]),
        ("char ‸a __at(0x20) = 1;", [0x20]), ("char ‸a __at 0x20;", [0x20]),
        ("char *‸a @ 0x20, **‸b @ 0x21;", [0x20, 0x21]),
        ("char (*‸a)[3] @ 0x20;", [0x20]),
        ("char (*‸a[2])(char, int (*)(int)) @ 0x20;", [0x20]),
        ("char (*(*‸a)(void))[3] @ 0x20;", [0x20]), ("__at(0x20) char (*‸a)(void), b;", [0x20]),
        ("__at(0x20) struct { char m; char *n; } ‸a;", [0x20]),
        ("char (*‸a)(void) __at 0x20;", [0x20]),
        ("bit ‸a @ PORTB.3;", [BitAddress("PORTB", 3)]),
        ("bit ‸a @ 0x20.3;", [BitAddress(0x20, 3)]),
        ("bit ‸a @ &flags*8;", [BitAddress("flags", 0)]),
        ("bit ‸a @ (unsigned int) &flags * 8 + 12;", [BitAddress("flags", 12)]),
        ("char a; __at = 1;", []),
    ],
)  # fmt: skip
def test_fixed_addresses_belong_to_the_declared_name(marked: str, addresses: list[object]) -> None:
    positions = []
    before = ""
    for part, behind in pairwise(marked.split(CARET)):
        before += part
        positions.append((FILE, 1, len(before) + 1, behind[0]))
    read = Read(marked.replace(CARET, ""))
    assert read.rewritten().addresses == dict(zip(positions, addresses, strict=True))
    assert read.said == []


def test_what_the_extensions_say_of_names() -> None:
    text = (
        "void __interrupt() a(void) { }\nvoid b(int (*x)(void)) __interrupt 0 { }\ninterrupt "
        "void c() { d(); }\n"
        "void e(void) __naked { }\n"
    )
    read = Read(text).rewritten()
    assert names(read.interrupts) == {"a", "b", "c"}
    assert names(read.naked) == {"e"}
    assert names(Read("void interrupt(void) { }").rewritten().interrupts) == {"interrupt"}


def names(positions: set[Position]) -> set[str]:
    return {name for *_, name in positions}


def test_an_attribute_that_would_change_the_program_is_named() -> None:
    read = Read("int a __attribute__((packed, aligned(8), format(x, aligned), __mode__(QI)));")
    assert read.plain() == "int a ;"
    assert read.said == [
        "m.c:1:30: c-attribute: the attribute 'aligned' is ignored",
        "m.c:1:62: c-attribute: the attribute 'mode' is ignored",
    ]


def test_assembly_outside_and_inside_functions() -> None:
    read = Read('asm("one");\nvoid f(void) {\n asm("two\\n\\tthree \\"x\\"");\n}\n__asm\n four\n__endasm;')
    rewritten = read.rewritten()
    assert [(number, place.line) for number, place in rewritten.file_asm] == [(2, 1), (1, 5)]
    assert [block.lines for block in read.blocks] == [
        ((6, " four"),),
        ((6, " four"),),
        ((1, "one"),),
        ((3, "two"), (3, '\tthree "x"')),
    ]


def test_asm_made_by_a_macro_is_assembly_only_with_parentheses() -> None:
    made = "#define MADE(start) start##m\nvoid f(void) {\n MADE(as)"
    assert Read(f'{made}("nop");\n}}').plain() == "void f ( void ) { __servogen_asm ( 0 ) ; }"
    assert Read(f"{made} nop;\n}}").plain() == "void f ( void ) { asm nop ; }"


def test_an_interrupt_word_behind_a_stray_parenthesis_names_no_function() -> None:
    read = Read("void f(void)) __interrupt(0) { }")
    assert read.plain() == "void f ( void ) ) { }"
    assert read.rewritten().interrupts == set()


def test_an_address_that_is_not_a_number() -> None:
    read = Read("char a @ here;")
    read.rewritten()
    assert read.said == ["m.c:1:8: error c-address: a fixed address must be a number"]


def test_assembly_with_operands_is_refused() -> None:
    read = Read('void f(void) { asm("x" : "=r" (a)); }')
    assert read.plain() == "void f ( void ) { __servogen_asm ( 0 ) ; }"
    assert read.said == [
        "m.c:1:24: error c-unsupported: assembly with operands is not supported: asm() takes only strings"
        " // in assembly, the global variable v is called _v"
    ]
    assert read.blocks == [AsmBlock(FILE, ())]
