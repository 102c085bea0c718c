"""Warnings about legal C that is seldom intended: where each points to, and what is next to it."""

from __future__ import annotations

from itertools import product

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.errors import InputError
from tests.compiler.marked import diagnostics, found_in, line_of, stated

GLOBALS = "unsigned char a, b, c, i, t[4]; int n; const char *s;\nstruct { unsigned char x; } o, *p = &o;\n"

LEVELS = (
    ("*", "/", "%"), ("+", "-"), ("<<", ">>"), ("<", "<=", ">", ">="), ("==", "!="), ("&",), ("^",), ("|",),
    ("&&",), ("||",),
)  # fmt: skip
"""The binary operators, those that are evaluated first in front (ISO C 6.5.5 to 6.5.14)."""
LEVEL = {op: number for number, ops in enumerate(LEVELS) for op in ops}
RELATIONS = {"<", "<=", ">", ">=", "==", "!="}
MISREAD = (
    {(outer, inner) for outer in "&|^" for inner in RELATIONS}
    | {(outer, inner) for outer in ("<<", ">>") for inner in "+-"}
    | {("|", "&"), ("|", "^"), ("^", "&"), ("||", "&&")}
)
"""(operator, the one that is evaluated before it) where a reader may take them the other way."""


def test_the_operators_whose_order_is_easily_misread() -> None:
    """Each pair of operators stands in a line of its own, with the inner one on the right and on the left."""
    pairs = [(outer, inner) for outer, inner in product(LEVEL, LEVEL) if LEVEL[inner] < LEVEL[outer]]
    forms = ("n = a {0} b {1} c;", "n = a {1} b {0} c;", "n = a {0} (b {1} c);", "n = (a {1} b) {0} c;")
    lines = [form.format(*pair) for pair in pairs for form in forms]
    text = GLOBALS + "void main(void) {\n" + "\n".join(lines) + "\n}"
    found = [each for each in diagnostics(text) if each.code == "c-precedence"]
    assert {each.hint for each in found} == {"put parentheses around what belongs together"}
    expected = []
    for number, (outer, inner) in enumerate(pairs):
        if (outer, inner) in MISREAD:
            words = f"'{inner}' is evaluated before '{outer}'"
            line = 4 + 4 * number
            expected += [(line, 5 + len(f"a {outer} "), words), (line + 1, 5, words)]
    assert [
        (each.location.line, each.location.column, each.message) for each in found if each.location
    ] == expected


POWER = "c-xor-power: '^' is exclusive or, not a power // 1 << n is a power of two"


def negation(op: str) -> str:
    return f"c-precedence: '!' is evaluated before '{op}' // write !(… {op} …)"


UNORDERED = (
    "c-unsequenced: '{}' is changed and used in one expression, in an undefined order // split it "
    "into several statements"
)
STRINGS = (
    "c-string-comparison: this compares the address of a string, not its characters // strcmp of "
    "<string.h> compares characters"
)
ELSE = "c-dangling-else: the 'else' belongs to this 'if' // put braces around the inner 'if'"
EITHER = "c-empty-body: the body of this '{}' is this ';' // what follows runs in either case"
ONCE = "c-empty-body: the body of this '{}' is this ';' // what follows runs once, after the loop"
INDENTED = (
    "c-indentation: this is indented like the statement above it, but does not depend on the "
    "condition // put braces around both"
)

ROWS: list[tuple[str, list[str]]] = [
    ("n = ‸2 ^ 8;", [POWER]), ("n = ‸10 ^ 3;", [POWER]), ("n = 3 ^ 2;", []), ("n = 2 ^ a;", []),
    ("n = a ^ 2;", []), ("n = 2 | 8;", []), ("n = !‸a & 1;", [negation("&")]),
    ("n = !‸a | b;", [negation("|")]), ("n = !‸a ^ b;", [negation("^")]), ("n = !‸a == b;", [negation("==")]),
    ("n = !‸a < b;", [negation("<")]), ("n = (!a) & 1;", []), ("n = (!a) == b;", []), ("n = !a == !b;", []),
    ("n = !a + 1;", []), ("n = !a && b;", []), ("n = a & !b;", []), ("n = ~a & 1;", []), ("n = -a & 1;", []),
    ('if (s == ‸"ab") a = 1;', [STRINGS]), ('if (‸"ab" != s) a = 1;', [STRINGS]),
    ('if (s < ‸"ab") a = 1;', [STRINGS]), ('s = "ab" + 1;', []),
    ("if (a) ‸if (b) c = 1; else c = 2;", [ELSE]),
    ("if (a) { if (b) c = 1; else c = 2; }", []), ("if (a) { if (b) c = 1; } else c = 2;", []),
    ("if (a) if (b) c = 1;", []),
    ("if (a) if (b) c = 1; else c = 2; else c = 3;", []),
    ("if (a) c = 1; else if (b) c = 2; else c = 3;", []),
    ("if (a)‸; c = 1;", [EITHER.format("if")]), ("if (a) ; else c = 1;", []),
    ("if (a) c = 1; else‸;", [EITHER.format("else")]),
    ("if (a) ; else‸;", [EITHER.format("else")]), ("if (a) { } else { }", []),
    # the order of changes (ISO C 6.5)
    ("‸i = i++ + 1;", [UNORDERED.format("i")]), ("‸i += i++;", [UNORDERED.format("i")]),
    ("‸t[i] = i++;", [UNORDERED.format("i")]), ("‸t[i++] = i;", [UNORDERED.format("i")]),
    ("‸t[i++] = i++;", [UNORDERED.format("i")]), ("n = ‸i++ + i++;", [UNORDERED.format("i")]),
    ("n = ‸i++ + i;", [UNORDERED.format("i")]), ("n = ‸i - --i;", [UNORDERED.format("i")]),
    ("n = ‸(char)i++ + i;", [UNORDERED.format("i")]),
    ("n = -‸i++ + i;", [UNORDERED.format("i")]),
    ("n = ‸two(i, i++);", [UNORDERED.format("i")]),
    ("n = ‸two((i++, 1), i);", [UNORDERED.format("i")]),
    ("n = ‸two(i = 1, i);", [UNORDERED.format("i")]),
    ("n = (‸i && c++) + c;", [UNORDERED.format("c")]),
    ("n = (‸i ? c++ : 1) + c;", [UNORDERED.format("c")]),
    ("n = (‸i ? 1 : c++) + c;", [UNORDERED.format("c")]),
    ("n = (‸i++ ? 1 : c) + i;", [UNORDERED.format("i")]),
    ("n = ‸t[i++] + i;", [UNORDERED.format("i")]),
    ("n = ‸‸a++ + b++ + a + b;", [UNORDERED.format("a"), UNORDERED.format("b")]),
    ("n = ‸i++ + i++ + i++;", [UNORDERED.format("i")]),
    ("p->x = ‸i++ + i;", [UNORDERED.format("i")]),
    ("p[i].x = i;", []), ("n = two(i, c++);", []), ("n = i++ && i;", []), ("n = i || i++;", []),
    ("n = i++ ? i : c;", []), ("n = (i++, i);", []), ("n = sizeof(i++) + i;", []), ("i = i + 1;", []),
    ("i += i;", []), ("i = c++ + b;", []), ("t[i] = i;", []), ("t[i] = t[i] + 1;", []), ("t[i++] = c;", []),
    ("i++; i++;", []),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), ROWS)
def test_a_statement_that_is_seldom_intended(text: str, said: list[str]) -> None:
    marked = f"{GLOBALS}int two(int x, int y) {{ return x - y + a; }}\nvoid main(void) {{ {text} }}"
    unrelated = ("c-comparison", "c-unused-result", "c-conversion", "c-overflow", "c-logical-constant")
    found = [each for each in found_in(marked) if not each[0].startswith(unrelated)]
    assert found == stated(marked, said)


LINES: list[tuple[str, list[str]]] = [
    ("if (a)\n    b = 1;\n    ‸c = 2;", [INDENTED]),
    ("while (a)\n    a--;\n    ‸c = 2;", [INDENTED]),
    ("for (i = 0; i < 3; i++)\n    a--;\n    ‸c = 2;", [INDENTED]),
    ("if (a)\n    b = 1;\nelse\n    b = 2;\n    ‸c = 2;", [INDENTED]),
    ("if (a)\n  b = 1;\nelse if (c)\n  b = 2;\n  ‸c = 2;", [INDENTED]),
    ("if (a)\n  while (b)\n    b--;\n    ‸c = 2;", [INDENTED]),
    ("if (a)\n  for (;b;)\n    b--;\n    ‸c = 2;", [INDENTED]),
    ("if (a)\n    b = 1;\nc = 2;", []), ("if (a)\n    b = 1;\n  c = 2;", []),
    ("if (a)\n    b = 1;\n     c = 2;", []), ("if (a)\nb = 1;\nc = 2;", []),
    ("if (a) {\n    b = 1; }\n    c = 2;", []), ("if (a) b = 1;\n       c = 2;", []),
    ("if (a)\n    b = 1; c = 2;", []), ("do\n    a--;\nwhile (a);\n    c = 2;", []),
    ("a = 1;\n    b = 1;\n    c = 2;", []),
    ("while (a)‸;\n{ b = 1; }", [ONCE.format("while")]),
    ("while (a)‸; { b = 1; }", [ONCE.format("while")]),
    ("while (a)‸;\n  b = 1;", [ONCE.format("while")]),
    ("for (i = 0; i < 9; i++)‸;\n  b = 1;", [ONCE.format("for")]),
    ("while (a);\nb = 1;", []), ("while (a); b = 1;", []), ("  while (a);\n  b = 1;", []),
    ("while (a)\n  ;\n  b = 1;", []), ("while (a)\n  ;\n{ b = 1; }", []), ("while (a) a--;\n{ b = 1; }", []),
    ("while (a) { }\n  b = 1;", []),
    ("switch (a) {\ncase 1:\n  if (b)\n    c = 1;\n    case 2:\n  c = 2;\n}", []),
    ("if (a)\n    b = 1;\n    again: if (c) goto again;", []),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), LINES)
def test_what_the_layout_suggests(text: str, said: list[str]) -> None:
    marked = f"{GLOBALS}void main(void) {{\n{text}\n}}"
    assert found_in(marked) == stated(marked, said)


SIZE = (
    "c-sizeof: '{}' is a pointer here: this is not the size of the array // pass the length as "
    "another parameter"
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("int f(int u[3]) { return ‸sizeof u + u[0]; }", "u"),
        ("int f(int k, int u[]) { return ‸sizeof(u) + u[k]; }", "u"),
        ("int f(int *u) { return sizeof u + u[0]; }", ""),
        ("int f(int u[3]) { return sizeof u[0] + u[0]; }", ""),
        ("int f(int k) { int u[3]; u[0] = k; return sizeof u + u[0]; }", ""),
        ("int f(void) { return sizeof n; }", ""),
        ("int f() { return sizeof(int); }", ""),
    ],
)
def test_the_size_of_an_array_parameter(text: str, said: str) -> None:
    marked = f"int n;\n{text}\nvoid main(void) {{ }}"
    assert found_in(marked) == stated(marked, [SIZE.format(said)] if said else [])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("static char ‸x;", "'x' is never used"), ("static char ‸x = 1;", "'x' is never used"),
        ("static void ‸g(void) { }", "'g' is never called"),
        ("static void g(void);", ""), ("static inline void g(void) { }", ""), ("static volatile char x;", ""),
        ("static const char x = 1;", ""), ("static char x @ 0x30;", ""),
        ("static void __interrupt() g(void) { GIE = 1; }", ""),
        ("char x; void g(void) { }", ""),
        ("static char x; void g(void) { x = 1; }", ""),
        ("static void g(void) { } void (*q)(void) = g;", ""),
        ('static char x; void g(void) { asm("clrf _x"); }', ""),
        ('static void g(void) { } void h(void) { asm("call _g"); }', ""),
        ("typedef char q;", ""),
    ],
)  # fmt: skip
def test_static_names_that_a_file_never_uses(text: str, said: str) -> None:
    marked = f"{text}\nvoid main(void) {{ }}"
    found = [each for each in found_in(marked) if not each[0].startswith("c-interrupt-enable")]
    assert found == stated(marked, [f"c-unused: {said}"] if said else [])


@pytest.mark.parametrize(("name", "said"), [("more.h", 0), ("MORE.H", 0), ("more.c", 2)])
def test_a_header_may_hold_more_than_is_used(name: str, said: int) -> None:
    other = "static char x;\nstatic void g(void) { }\n"
    options = Options("xc8", include=lambda wanted, _: (wanted, other))
    found = compile_sources(
        [Source(f'#include "{name}"\nvoid main(void) {{ }}', "main.c")], options
    ).diagnostics
    assert [line_of(each) for each in found] == [
        "c-unused: 'x' is never used",
        "c-unused: 'g' is never called",
    ][:said]


def test_static_names_are_not_judged_after_an_error() -> None:
    with pytest.raises(InputError) as caught:
        compile_sources([Source("static char x;\nint y = z;\nvoid main(void) { }")], Options("xc8"))
    assert [each.message for each in caught.value.diagnostics] == ["'z' is not declared"]
