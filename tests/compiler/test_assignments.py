"""Values of assignments and what assignments convert."""

from __future__ import annotations

import pytest

from tests.compiler.variables import value

LEVELS = ("none", "speed", "size")


HEAD = "#include <pic16f84.h>\n#include <stdbool.h>\n"


@pytest.mark.parametrize("level", LEVELS)
def test_the_address_of_a_structure_that_is_assigned_on_is_evaluated_once(level: str) -> None:
    text = (
        "struct pair { unsigned char a, b; }; struct pair p[3]; unsigned char n = 2, seen;\n"
        "void main(void) { p[0].a = 7; p[0].b = 9; p[2] = p[--n] = p[0];\n"
        "seen = p[1].a + p[1].b + p[2].a * 2 + p[2].b * 2; while (1); }\n"
    )
    assert value(HEAD + text, "n", "sdcc", level) == 1
    assert value(HEAD + text, "seen", "sdcc", level) == 3 * (7 + 9)


@pytest.mark.parametrize("level", LEVELS)
def test_a_bit_field_of_bool_is_true_for_every_value_but_0(level: str) -> None:
    """C99 6.3.1.2; an `unsigned : 1` keeps the lowest bit."""
    text = (
        "struct { bool b : 1; unsigned char u : 1; } s; volatile unsigned char z = 2; unsigned char seen;\n"
        "void main(void) { s.b = z & 2; s.u = z & 2; seen = s.b | s.u << 1;\n"
        "s.b = z & 1; s.u = z + 1; seen |= s.b << 2 | s.u << 3; while (1); }\n"
    )
    assert value(HEAD + text, "seen", "sdcc", level) == 0b1001


@pytest.mark.parametrize("level", LEVELS)
def test_one_bit_of_a_structure_behind_a_pointer_or_an_index_is_set_and_cleared_alone(level: str) -> None:
    text = (
        "struct bits { unsigned char low : 3, one : 1, two : 1; } s[3], *p = &s[1];\n"
        "unsigned char n = 2, seen;\n"
        "void main(void) { s[1].low = 5; s[1].two = 1; s[2].low = 2; s[2].one = 1;\n"
        "p->one = 1; p->two = 0; s[n].one = 0; s[n].two = 1;\n"
        "seen = s[1].low | s[1].one << 3; seen |= s[1].two << 4; seen ^= (s[2].low | s[2].one << 3) << 4;\n"
        "seen ^= s[2].two << 7; while (1); }\n"
    )
    assert value(HEAD + text, "seen", "sdcc", level) == 0b0000_1101 ^ 0b0010_0000 ^ 0b1000_0000
