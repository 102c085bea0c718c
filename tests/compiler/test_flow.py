"""Warnings about variables and ends of functions: every form of statement, and the programs next to each."""

from __future__ import annotations

import pytest

from tests.compiler.marked import found_in, stated

GLOBALS = "unsigned char a, b, t[4]; volatile unsigned char v; unsigned char *q;\n"
READ = "c-uninitialised: '{}' is read before it is set"
PERHAPS = "c-uninitialised: '{}' is set only if a condition holds, but is read in any case"


def reported(marked: str, said: list[str]) -> None:
    unrelated = ("c-conversion", "c-logical", "c-missing-return", "c-input-pin", "c-unused: the parameter")
    found = [each for each in found_in(marked) if not each[0].startswith(unrelated)]
    assert found == stated(marked, said)


# what `u` is read as, in the order of evaluation
READS: list[tuple[str, str]] = [
    ("a = ‸u;", READ), ("a = b + ‸u;", READ), ("a = -‸u;", READ), ("a = t[‸u];", READ), ("t[‸u] = 1;", READ),
    ("q = t + ‸u;", READ), ("use(‸u);", READ), ("use((unsigned char)‸u);", READ), ("‸u += 1; a = u;", READ),
    ("a = ‸u++;", READ), ("a = b, v = ‸u;", READ), ("if (‸u) a = 1;", READ),
    ("if (‸u == 1 || b) a = 1;", READ), ("while (‸u) a = 1;", READ), ("do a = 1; while (‸u);", READ),
    ("switch (‸u) { case 1: a = 1; }", READ), ("for (a = 0; a < ‸u; a++) b = 1;", READ),
    ("for (a = 0; a < 3; a += ‸u) b = 1;", READ), ("a = b ? ‸u : 1;", READ), ("a = b ? 1 : ‸u;", READ),
    ("a = ‸u ? 1 : 2;", READ), ("a = b && ‸u;", READ), ("a = ‸u && b;", READ), ("a = u = 1; a = u;", ""),
    ("a = ‸u; a = u;", READ), ("u = 1; a = u;", ""), ("u = ‸u + 1;", READ), ("a = sizeof(u);", ""),
    ("if (b) u = 1; a = ‸u;", PERHAPS), ("if (b) u = 1; a = ‸u; a = u;", PERHAPS),
    ("if (b) a = 1; else u = 1; a = ‸u;", PERHAPS),
    ("if (b) u = 1; else a = 1; a = ‸u;", PERHAPS),
    ("if (b) u = 1; else u = 2; a = u;", ""),
    ("if (b) u = 1; else { a = 1; return; } a = u;", ""),
    ("if (b) { a = 1; return; } else u = 1; a = u;", ""),
    ("if (b) { a = 1; return; } a = ‸u;", READ),
    ("if (b) { u = 1; return; } a = ‸u;", PERHAPS),
    ("if ((u = b)) a = 1; a = u;", ""),
    ("if (b) { if (a) u = 1; else u = 2; } else u = 3; a = u;", ""),
    ("if (b) u = 1; if (b) a = u;", ""), ("a = b && (u = 1); a = ‸u;", PERHAPS),
    ("a = b || (u = 1); a = ‸u;", PERHAPS), ("a = (u = b) && b; a = u;", ""),
    ("a = b ? (u = 1) : (u = 2); a = u;", ""), ("a = b ? (u = 1) : 2; a = ‸u;", PERHAPS),
    ("a = b ? 2 : (u = 1); a = ‸u;", PERHAPS), ("while (b) u = 1; a = u;", ""),
    ("for (a = 0; a < 3; a++) u = 1; a = u;", ""),
    ("for (u = 0; u < 3; u++) b = u;", ""), ("do u = 1; while (u);", ""), ("while (‸u) u = 1;", READ),
    ("while (b) { a = ‸u; u = 1; }", READ), ("while (b) { if (a) a = u; u = 1; }", ""),
    ("while (b) { if (a) a = u; b = u = 1; }", ""),
    ("while (b) { if (a) a = ‸u; } ", READ), ("while (b) { if (a) u = 1; a = u; }", ""),
    ("do { if (a) a = u; } while ((u = b));", ""),
    ("for (; b; ‸u++) { if (a) a = u; }", READ), ("while (b) { u = 1; } if (a) a = u;", ""),
    ("while (b) { if (b) b = 2; } if (a) u = 1; a = ‸u;", PERHAPS),
    ("while (b) { if (b) u = 2; } a = ‸u;", PERHAPS),
    ("switch (b) { case 1: u = 1; break; default: u = 2; } a = u;", ""),
    ("switch (b) { case 1: u = 1; } a = u;", ""), ("switch (b) { case 1: a = ‸u; }", READ),
    ("{ u = 1; } a = u;", ""), ("q = &u; a = u;", ""), ("use(*&‸u);", READ),
    ("again: if (b) { u = 1; goto again; } a = u;", ""),
    ('asm("movwf _u"); a = u;', ""),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), READS)
def test_a_variable_is_read_before_it_is_set(text: str, said: str) -> None:
    functions = f"void use(char x) {{ a = x; }}\nvoid f(void) {{ unsigned char u; {text} }}\n"
    marked = f"{GLOBALS}{functions}void main(void) {{ f(); use(1); }}"
    reported(marked, [said.format("u")] if said else [])


def test_a_value_returned_before_it_is_set() -> None:
    marked = GLOBALS + "char f(void) { char u; return ‸u; }\nvoid main(void) { a = f(); }"
    reported(marked, [READ.format("u")])


@pytest.mark.parametrize(
    "declared", ["volatile char u", "static char u", "char u = 1", "char u[2]", "struct { char x; } u"]
)
def test_what_is_not_watched(declared: str) -> None:
    access = {"char u[2]": "u[0]", "struct { char x; } u": "u.x"}.get(declared, "u")
    reported(f"{GLOBALS}void main(void) {{ {declared}; a = {access}; }}", [])


def test_a_pointer_is_read_where_something_is_stored_through_it() -> None:
    reported(GLOBALS + "void main(void) { char *u; *‸u = 1; }", [READ.format("u")])
    reported(GLOBALS + "void main(void) { char *u; ‸u[2] = 1; }", [READ.format("u")])


def test_each_variable_is_reported_once_and_by_its_name() -> None:
    marked = GLOBALS + "void main(void) { char u, w; a = ‸u; b = ‸w; a = u + w; }"
    reported(marked, [READ.format("u"), READ.format("w")])


UNUSED = "c-unused: '{}' is never used"
ONLY_SET = "c-unused: '{}' is set and never used"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("char ‸u;", [UNUSED]), ("char ‸u = 1;", [ONLY_SET]), ("char ‸u; u = 1;", [ONLY_SET]),
        ("char ‸u = a; u += 2;", [ONLY_SET]), ("char ‸u = 0; u++;", [ONLY_SET]),
        ("char ‸u = 0; if (a) u++;", [ONLY_SET]),
        ("char ‸u = 0; if (a) b = 1; else --u;", [ONLY_SET]),
        ("char ‸u = 0; while (a) u--;", [ONLY_SET]),
        ("char ‸u = 0; do u++; while (a);", [ONLY_SET]),
        ("char ‸u = 0; for (; a; u++) b = 1;", [ONLY_SET]),
        ("char ‸u = 0; for (; a; ) u++;", [ONLY_SET]),
        ("char ‸u = 0; { u++; }", [ONLY_SET]), ("char u = 0; a = u++;", []),
        ("char u = 0; for (; u++; ) b = 1;", []), ("char u = 0; while (u--) b = 1;", []),
        ("char u = 0; if (u++) b = 1;", []),
        ("char u = 0; ‸u = u;", ["c-no-effect: 'u' is assigned to itself"]),
        ("char u; (void)‸u;", [READ]), ("volatile char u; u = 1;", []), ("static char u; u = 1;", []),
        ("const char u = 1; a = u;", []), ("char u[2]; u[0] = 1;", []),
        ("{ char ‸u; } { char ‸w; w = 1; }", [UNUSED, "c-unused: 'w' is set and never used"]),
        ('char u; asm("nop");', []),
    ],
)  # fmt: skip
def test_a_variable_that_is_not_used(text: str, said: list[str]) -> None:
    reported(f"{GLOBALS}void main(void) {{ {text} }}", [words.format("u") for words in said])


def parameter(name: str) -> str:
    return f"c-unused: the parameter '{name}' is never used // '(void){name};' marks it as intentional"


@pytest.mark.parametrize(
    ("head", "text", "said"),
    [
        ("char ‸x", "", ["x"]),
        ("char ‸x, char y, char ‸z", "a = y;", ["x", "z"]),
        ("char ‸x", "x = 1;", ["x"]), ("char x", "(void)x;", []), ("char x", "a = x;", []),
        ("char x", "a = sizeof(x);", []), ("char x", 'asm("nop");', []), ("void", "", []),
    ],
)  # fmt: skip
def test_a_parameter_that_is_not_used(head: str, text: str, said: list[str]) -> None:
    marked = f"{GLOBALS}void f({head}) {{ {text} }}\nvoid main(void) {{ }}"
    found = [each for each in found_in(marked) if not each[0].startswith("c-no-effect")]
    assert found == stated(marked, [parameter(name) for name in said])


COMPLETING = [
    # bodies through which the end of the function can be reached
    "", "a = 1;", "if (n) return 1;", "if (n) return 1; else a = 1;", "if (n) a = 1; else return 1;",
    "if (n) return 1; else if (a) return 2;", "while (n) return 1;", "for (; n; ) return 1;",
    "do { return 1; } while (n);", "while (1) { if (n) break; }", "while (1) { if (n) a = 1; else break; }",
    "while (1) { { break; } }", "for (;;) break;", "switch (n) { case 1: return 1; }",
    "switch (n) { case 1: return 1; default: a = 1; }",
    "switch (n) { case 1: break; default: return 1; }",
    "switch (n) { default: if (a) break; return 1; }",
    "{ a = 1; }", "goto x; x: a = 1;", "if (n) goto x; return 1; x: a = 1;",
    "if (n) goto x; return 1; { x: a = 1; }",
    "while (1) { switch (n) { case 1: return 1; } break; }",
]  # fmt: skip
RETURNING = [
    "return 1;", "{ return 1; }", "a = 1; return 1;", "if (n) return 1; else return 2;",
    "if (n) return 1; return 2;",
    "if (n) { return 1; } else { a = 1; return 2; }",
    "while (1) ;", "while (1) a = 1;", "for (;;) { if (n) return 1; }", "do a = 1; while (1);",
    "while (1) { while (n) { a = 1; break; } }",
    "for (;;) { switch (n) { case 1: a = 1; break; } }",
    "switch (n) { case 1: return 1; default: return 2; }",
    "switch (n) { default: return 2; case 1: return 1; }",
    "switch (n) { case 1: { return 1; } default: while (1) ; }",
    "x: a = 1; goto x;", "if (n) goto x; return 1; x: return 2;",
    "while (1) { if (n) return 1; else continue; }",
    'asm("movlw 1");',
]  # fmt: skip


@pytest.mark.parametrize("text", COMPLETING + RETURNING)
def test_a_function_that_can_end_without_a_value(text: str) -> None:
    marked = (
        f"{GLOBALS}char {'‸' * (text in COMPLETING)}f(char n) {{ {text} }}\nvoid main(void) {{ a = f(a); }}"
    )
    ending = ["c-missing-return: 'f' can reach its end without returning a value"] * (text in COMPLETING)
    assert [each for each in found_in(marked) if each[0].startswith("c-missing-return")] == stated(
        marked, ending
    )


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        ("int main(void) { a = 1; }", "xc8"),
        ("void f(void) { a = 1; } void main(void) { f(); }", "xc8"),
        ("char f(void) { reset(); } void main(void) { a = f(); }", "c2c"),
        ("char f(void) __naked { __asm\n return\n __endasm; } void main(void) { a = f(); }", "sdcc"),
    ],
)
def test_functions_that_need_no_return(text: str, dialect: str) -> None:
    assert found_in(f"unsigned char a;\n{text}", dialect) == []


def test_nothing_is_said_about_a_function_with_an_error() -> None:
    marked = "char f(char n) { char u; ‸x = 1; }\nvoid main(void) { f(1); }"
    assert found_in(marked) == stated(marked, ["error c-undeclared: 'x' is not declared"])
