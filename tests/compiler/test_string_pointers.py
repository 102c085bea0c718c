"""Which `char *` becomes a pointer to const: where strings reach it and nothing is written through it."""

from __future__ import annotations

import pytest

from tests.compiler.marked import diagnostics, found_in, stated

READ_ONLY = [
    "void f(char *t) { a = *t; } void main(void) { f(\"x\"); }",
    "void f(char *t) { a = t[1]; } void main(void) { f(\"xy\"); }",
    "void f(char *t) { while (*t) a = *t++; } void main(void) { f(\"x\"); }",
    "void f(int n, char *t) { a = t[n]; } void main(void) { f(1, \"xy\"); }",
    "void f(char *t) { char *u = t; a = *u; } void main(void) { f(\"x\"); }",
    "void f(char *t) { char *u; u = t + 1; a = *u; } void main(void) { f(\"xy\"); }",
    "void g(char *u) { a = *u; } void f(char *t) { g(t); } void main(void) { f(\"x\"); }",
    "char *f(void) { return \"x\"; } void main(void) { a = *f(); }",
    "char *s; void main(void) { s = \"x\"; a = *s; }",
    "char *s = \"x\"; void main(void) { a = s[0]; }",
    "char *s, *t; void main(void) { s = t = \"x\"; a = *s + *t; }",
    "char *s[2] = {\"x\", \"y\"}; void main(void) { a = s[1][0]; }",
    "char *s[2]; void main(void) { s[0] = \"x\"; a = *s[0]; }",
    "struct { char *s; } o; void main(void) { o.s = \"x\"; a = *o.s; }",
    "struct { char n; char *s; } o = {1, \"x\"}; void main(void) { a = *o.s; }",
    "struct { char *s; } o = {.s = \"x\"}; void main(void) { a = *o.s; }",
    "void f(char *t) { a = *t; } void main(void) { f(a ? \"x\" : \"y\"); }",
    "void f(char *t) { a = *t; } void main(void) { f((a = 1, \"x\")); }",
    "void f(char *t); void f(char *u) { a = *u; } void main(void) { f(\"x\"); }",
    "void f(char *t) { a = *t; } void main(void) { char b[2]; b[0] = 1; f(b); f(\"x\"); }",
    "void f(char *t) { a = *t; } void main(void) { f(&\"xy\"[1]); }",
    "void main(void) { char *t = \"x\"; t++; a = *t; }",
    "void f(char t[]) { a = t[1]; } void main(void) { f(\"xy\"); }",
    "void f(char t[3]); void f(char *u) { a = *u; } void main(void) { f(\"x\"); }",
    "void f(char t[]) { a = *t; } void f(char *); void main(void) { f(\"x\"); }",
    "void g(char u[]) { a = *u; } void f(char t[]) { g(t); } void main(void) { f(\"x\"); }",
    "void f(char t) { a = t; } void main(void) { char *u = \"x\"; f(u[0]); }",
]  # fmt: skip
WRITTEN = [
    "void f(char *t) { *t = 1; } void main(void) { f(\"x\"); }",
    "void f(char *t) { t[1] = 1; } void main(void) { f(\"x\"); }",
    "void f(char t[]) { t[1] = 1; } void main(void) { f(\"x\"); }",
    "void f(char *); void f(char t[]) { *t = 1; } void main(void) { f(\"x\"); }",
    "void f(char *t) { *t += 1; } void main(void) { f(\"x\"); }",
    "void f(char *t) { (*t)++; } void main(void) { f(\"x\"); }",
    "void f(char *t) { --*t; } void main(void) { f(\"x\"); }",
    "void f(char *t) { *t++ = 1; } void main(void) { f(\"x\"); }",
    "void f(char *t) { *(t + 1) = 1; } void main(void) { f(\"x\"); }",
    "void f(char *t) { char *u = t; *u = 1; } void main(void) { f(\"x\"); }",
    "void g(char *u) { *u = 1; } void f(char *t) { g(t); } void main(void) { f(\"x\"); }",
    "char *s; void main(void) { s = \"x\"; s[0] = 1; }",
    "char *s = \"x\"; void main(void) { *s = 1; }",
    "char *s[2] = {\"x\", \"y\"}; void main(void) { s[1][0] = 1; }",
    "struct { char *s; } o; void main(void) { o.s = \"x\"; *o.s = 1; }",
    "struct { char *s; } o; void main(void) { o.s = \"x\"; o.s[1] = 1; }",
    "char *f(void) { return \"x\"; } void main(void) { char *t = f(); *t = 1; }",
]  # fmt: skip


@pytest.mark.parametrize("text", READ_ONLY)
def test_a_pointer_that_only_reads_takes_a_string(text: str) -> None:
    assert diagnostics(f"unsigned char a;\n{text}") == ()


@pytest.mark.parametrize("text", WRITTEN)
def test_a_pointer_that_something_is_written_through_takes_no_string(text: str) -> None:
    found = [each for each in diagnostics(f"unsigned char a;\n{text}") if each.severity == "error"]
    assert [each.code for each in found] == ["c-const"]
    assert "would drop const: 'const unsigned char *' may point to flash" in found[0].message


def test_a_function_of_the_library_is_known_by_its_declaration() -> None:
    head = "#include <string.h>\nunsigned char a, b[3]; char *s;\n"
    for call in ("a = strlen(s);", "strcpy(b, s);", "a = strcmp(s, b);"):
        assert diagnostics(f'{head}void main(void) {{ s = "x"; {call} a = *s; }}') == ()
    for call in ("strcpy(s, b);", "strcat(s, b);", "memset(s, 0, 1);"):
        marked = f'{head}void main(void) {{ s = ‸"x"; {call} a = *s; }}'
        said = (
            "error c-const: the assignment would drop const: 'const unsigned char *' may point to flash, "
            "'unsigned char *' cannot // declare the pointer as a pointer to const"
        )
        assert found_in(marked) == stated(marked, [said])
