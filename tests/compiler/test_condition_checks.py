"""Warnings about conditions: where each points to, and the programs next to it that get none."""

from __future__ import annotations

import pytest

from tests.compiler.marked import found_in, stated

GLOBALS = "unsigned char a, b, c; int n; volatile char v; float f;\n"


def body(text: str, said: list[str]) -> None:
    marked = f"{GLOBALS}void main(void) {{ {text} }}"
    assert found_in(marked) == stated(marked, said)


def only_tests(op: str) -> str:
    return f"c-logical-constant: '{op}' only tests whether this constant is 0 // '{op[0]}' combines the bits"


@pytest.mark.parametrize("op", ["&&", "||"])
@pytest.mark.parametrize(
    "marked",
    [
        "a op ‸4", "‸4 op a", "6 op ‸4", "a op ‸2", "a op ‸0x01", "a op ‸0X1", "a op ‸0x0", "a op -‸1",
        "a op ‸010", "a op ‸2u", "a op ‸2L", "a op ‸2UL", "a op ‸2LL", "‸3 op 1", "a op ‸99",
    ],
)  # fmt: skip
def test_a_constant_that_looks_like_a_mask_is_not_a_condition(marked: str, op: str) -> None:
    body(f"if ({marked.replace('op', op)}) b = 1;", [only_tests(op)])


@pytest.mark.parametrize("op", ["&&", "||"])
@pytest.mark.parametrize(
    "text", ["a op 0", "1 op a", "a op 01", "a op 00", "a op 1UL", "a op 'x'", "a op -0", "a op b"]
)
def test_0_and_1_are_conditions(text: str, op: str) -> None:
    body(f"if ({text.replace('op', op)}) b = 1;", [])


NOT = "c-logical-constant: '!' of a constant is 0 or 1 // '~' inverts each bit"
BEFORE = "c-precedence: '!' is evaluated before '{0}' // write !(… {0} …)"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a &= !‸4;", [NOT]), ("a |= !‸0x04;", [NOT]), ("a ^= !(‸1 << 2);", [NOT]), ("a = b & !‸4;", [NOT]),
        ("a = b | !~‸4;", [NOT]), ("a = !‸‸4 & b;", [BEFORE.format("&"), NOT]), ("a = (!‸4) | b;", [NOT]),
        ("a = b & (c | !‸4);", [NOT]), ("a = b & !c;", []), ("a &= !c;", []), ("a += !4;", []),
        ("a = !4;", []), ("a = b + !4;", []), ("a &= ~4;", []), ("a = b & -4;", []),
    ],
)  # fmt: skip
def test_the_logical_not_of_a_mask(text: str, said: list[str]) -> None:
    body(text, said)


@pytest.mark.parametrize("op", ["==", "!=", "<", "<=", ">", ">="])
def test_a_variable_compared_with_itself(op: str) -> None:
    body(f"if (‸n {op} n) b = 1;", ["c-comparison: 'n' is compared with itself"])
    others = (
        "n {} a", "v {} v", "f {} f", "PORTB {} PORTB", "portb {} portb", "RB0 {} RB0", "(n + 1) {} n",
    )  # fmt: skip
    body(" ".join(f"if ({other.format(op)}) b = 1;" for other in others), [])


def test_a_local_variable_compared_with_itself() -> None:
    for kind, said in (("int", True), ("volatile int", False), ("float", False), ("double", False)):
        mark = "‸" if said else ""
        one = f"void g({kind} t) {{ if ({mark}t == t) b = 1; }}\n"
        marked = f"{GLOBALS}{one}void main(void) {{ {kind} u = n; if ({mark}u != u) b = 1; g(u); }}"
        words = ["c-comparison: 't' is compared with itself", "c-comparison: 'u' is compared with itself"]
        assert found_in(marked) == stated(marked, words if said else [])


def always(which: str) -> str:
    other = {"true": "&&", "false": "||"}[which]
    return f"c-comparison: these two comparisons together are always {which} // '{other}' may be meant"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("‸a != 1 || a != 2", "true"), ("‸1 != a || 2 != a", "true"), ("‸a >= 3 || a <= 3", "true"),
        ("‸a > 1 || a < 2", "true"), ("‸n > -3 || n < -2", "true"), ("‸2 > a || a > 1", "true"),
        ("‸a < 3 && a > 7", "false"), ("‸3 > a && 7 < a", "false"), ("‸a < 2 && a > 1", "false"),
        ("‸a == 1 && a == 2", "false"), ("‸a <= 4 && a >= 5", "false"), ("a > 1 || a < 1", ""),
        ("a <= 4 && a >= 4", ""), ("a < 3 || a > 7", ""), ("a == 1 || a == 2", ""), ("a != 1 && a != 2", ""),
        ("a > 4 && a > 4", ""), ("a < 4 && a < 4", ""), ("a == 4 && a == 4", ""), ("a >= 5 || a >= 5", ""),
        ("a <= 5 || a <= 5", ""), ("a != 5 || a != 5", ""), ("a != 1 || b != 2", ""),
        ("a != 1 || (a + 1) != 2", ""), ("a != b || a != 2", ""), ("a != 1 || a", ""),
    ],
)  # fmt: skip
def test_two_comparisons_that_decide_each_other(text: str, said: str) -> None:
    body(f"if ({text}) b = 1;", [always(said)] if said else [])


def never(names: str) -> str:
    return f"c-loop-condition: the loop never changes {names}, which its condition tests"


@pytest.mark.parametrize(
    ("loop", "said"),
    [
        ("for (i = 0; ‸i < 8; j++) t[j] = i;", "'i'"),
        ("for (i = 0; ‸8 > i; j++) t[j] = i;", "'i'"),
        ("for (i = 0; ‸i < j; a++) t[i] = j;", "'i' and 'j'"),
        ("for (i = 0; ‸i < 8; j++) t[i] = 1;", "'i'"),
        ("for (i = 0; ‸i < 8; j++) a = -i;", "'i'"),
        ("for (i = 0; ‸i + 1 < 8; j++) t[j] = i;", "'i'"),
        ("for (i = 0; ‸i < m; j++) t[j] = m;", "'i' and 'm'"),
        ("for (i = 0; i < 8; i++) t[j] = i;", ""), ("for (i = 0; i < 8; i += 2) t[j] = i;", ""),
        ("for (i = 8; i > 0; --i) t[j] = i;", ""),
        ("for (i = 0; i < 8; j++) { t[j] = 1; i++; }", ""),
        ("for (i = 0; i < 8; j++) { i = t[j]; }", ""),
        ("for (i = 0; i < 8; j++) { i--; }", ""), ("for (i = 0; i < 8; j++) { ++i; }", ""),
        ("for (i = 0; i < 8; j++) { set(&i); }", ""),
        ("for (i = 0; i < 8; j++) { if (a) break; }", ""),
        ("for (i = 0; i < 8; j++) { if (a) return; }", ""),
        ("for (i = 0; i < 8; j++) { if (a) goto out; } out: ;", ""),
        ("for (i = 0; i < 8; ) t[j] = i;", ""), ("for (i = 0; i < a; j++) t[j] = i;", ""),
        ("for (i = 0; a < 8; j++) t[j] = i;", ""), ("for (i = 0; !i; j++) t[j] = i;", ""),
        ("for (i = 0; i < get(); j++) t[j] = i;", ""),
        ("for (i = 0; w < 8; j++) t[j] = i;", ""), ("for (; 1 < 0; j++) t[j] = i;", ""),
    ],
)  # fmt: skip
def test_a_loop_that_does_not_change_what_it_tests(loop: str, said: str) -> None:
    marked = (
        f"{GLOBALS}char t[9]; char get(void) {{ return v; }} void set(char *p) {{ *p = 1; }}\n"
        f"void run(char m) {{ char i = 1, j = a; volatile char w = m; {loop} t[0] = i + j + w + get(); }}\n"
        "void main(void) { TRISB = 0; set(t); run(a); }"
    )
    assert found_in(marked) == stated(marked, [never(said)] if said else [])


ENUM = "enum e { A, B, C } x; "
MISSING = "c-case-missing: there is no case for {} // add the case, or a default"


@pytest.mark.parametrize(
    ("head", "switched", "said"),
    [
        (ENUM, "‸switch (x) { case A: a = 1; }", "B, C"),
        (ENUM, "‸switch (x) { case A: case C: a = 1; }", "B"),
        (ENUM, "‸switch (x) { case 0: case B: case C: a = 1; }", "A"),
        (ENUM, "switch (x) { case A: case B: case C: a = 1; }", ""),
        (ENUM, "switch (x) { case A: a = 1; break; default: a = 2; }", ""),
        (ENUM, "‸switch (x) { case A: { case B: a = 1; } }", "C"),
        (ENUM, "switch (x + 1) { case B: a = 1; }", ""),
        (ENUM, "switch (a) { case A: a = 1; }", ""),
        ("enum e { A, B }; enum e x; ", "‸switch (x) { case A: a = 1; }", "B"),
        ("enum { A, B } x; ", "‸switch (x) { case A: a = 1; }", "B"),
        ("typedef enum { A, B } t; t x; ", "‸switch (x) { case A: a = 1; }", "B"),
        ("typedef enum e { A, B } t; const volatile t x; ", "‸switch (x) { case A: a = 1; }", "B"),
        ("enum e { A, B }; typedef enum e t; t x; ", "‸switch (x) { case B: a = 1; }", "A"),
        ("struct { enum { A, B } x; } s; ", "‸switch (s.x) { case A: a = 1; }", "B"),
        ("struct { enum { A, B } x; } s, *p = &s; ", "‸switch (p->x) { case A: a = 1; }", "B"),
        ("enum e { A, B }; int x; ", "switch (x) { case A: a = 1; }", ""),
        ("enum e { A, B }; ", "enum e y = a; ‸switch (y) { case A: a = 1; }", "B"),
    ],
)
def test_a_switch_over_an_enumeration_lacks_cases(head: str, switched: str, said: str) -> None:
    marked = f"{head}unsigned char a;\nvoid main(void) {{ {switched} }}"
    assert found_in(marked) == stated(marked, [MISSING.format(said)] if said else [])


def test_a_switch_over_a_parameter_of_an_enumeration() -> None:
    text = "enum e { A, B }; char a; void g(enum e x) { ‸switch (x) { case A: a = 1; } }\n"
    marked = text + "void main(void) { g(B); }"
    assert found_in(marked) == stated(marked, [MISSING.format("B")])
