"""The format strings of printf, taken apart: every conversion, flag and width (ISO C 7.21.6.1)."""

from __future__ import annotations

from itertools import product

import pytest

from servogen.compiler.sema.formats import FormatPart, parts

FLAG_BITS = {"-": 1, "0": 2, "+": 4, " ": 8}
SIGNED, CAPITALS = 16, 32
"""The bits that the library's format.c tests."""
BASES = {"d": (10, SIGNED), "i": (10, SIGNED), "u": (10, 0), "x": (16, 0), "X": (16, CAPITALS), "o": (8, 0)}


@pytest.mark.parametrize("letter", BASES)
def test_a_number_is_printed_with_its_base_width_and_flags(letter: str) -> None:
    base, more = BASES[letter]
    for flags, width, size in product(
        ("", "-", "0", "+", " ", "-+0"), ("", "1", "255"), ("", "h", "hh", "l")
    ):
        spelling = f"%{flags}{width}{size}{letter}"
        bits = sum(FLAG_BITS[flag] for flag in flags)
        numbers = (base, int(width or 0), bits | more)
        function = "long" if size == "l" else "int"
        if base == 10 and not width and not flags and size != "l":
            function, numbers = ("signed" if more else "unsigned"), ()
        (part,) = parts(spelling.encode())
        assert part == FormatPart(function, numbers=numbers, spelling=spelling)
        assert part.takes_value


def test_characters_strings_and_text() -> None:
    assert list(parts(b"%c")) == [FormatPart("char", spelling="%c")]
    assert list(parts(b"%s")) == [FormatPart("text", spelling="%s")]
    assert list(parts(b"%5s")) == [FormatPart("string", numbers=(5, 0), spelling="%5s")]
    assert list(parts(b"%-9s")) == [FormatPart("string", numbers=(9, 1), spelling="%-9s")]
    assert list(parts(b"%-0+9s")) == [FormatPart("string", numbers=(9, 1), spelling="%-0+9s")]
    assert list(parts(b"")) == []
    assert list(parts(b"x")) == [FormatPart("char", numbers=(ord("x"),))]
    assert list(parts(b"xy")) == [FormatPart("text", b"xy")]
    assert list(parts(b"%%")) == [FormatPart("char", numbers=(ord("%"),))]
    assert list(parts(b"a%%b%uc%d")) == [
        FormatPart("text", b"a%b"),
        FormatPart("unsigned", spelling="%u"),
        FormatPart("char", numbers=(ord("c"),)),
        FormatPart("signed", spelling="%d"),
    ]
    assert [part.takes_value for part in parts(b"ab%cd")] == [False, True, False]


@pytest.mark.parametrize(
    "text", ["%f", "%#x", "%*d", "%.2d", "%.d", "%256u", "%lld", "%", "%l", "%-", "%n", "%5.*d"]
)
def test_a_conversion_that_is_not_supported(text: str) -> None:
    (part,) = parts(text.encode())
    allowed = "%d %i %u %x %X %o %c %s, flags - 0 + and space, a width up to 255, hh h l"
    assert part == FormatPart("", spelling=text, problem=f"'{text}' is not supported; there are {allowed}")
