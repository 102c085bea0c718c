"""A line with the columns of its characters, its tokens, and the statement in it."""

from __future__ import annotations

import pytest

from servogen.pic.assembler.lexer import characters, tokens
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.source import SourceLine, lines_of, statement
from servogen.pic.assembler.substitution import Definition, parameters, paste, substitute
from servogen.pic.assembler.symbols import Symbols
from servogen.pic.assembler.text import MAX_LINE, Text


def columns(text: Text) -> list[tuple[str, int]]:
    return list(zip(text.chars, text.columns, strict=True))


def test_each_character_has_its_column_also_after_a_replacement() -> None:
    text = Text.of("abcdef", 3)
    assert [text.column(index) for index in (0, 5, 6, 9)] == [3, 8, 9, 9]
    assert Text.of("").column(0) == 1
    made = text.replace(1, 3, "XYZ")
    assert columns(made) == [("a", 3), ("X", 4), ("Y", 4), ("Z", 4), ("d", 6), ("e", 7), ("f", 8)]
    assert columns(text[2:4]) == [("c", 5), ("d", 6)]
    assert columns(Text.of("  a b  ").strip()) == [("a", 3), (" ", 4), ("b", 5)]
    assert columns(Text.of("   ").strip()) == []
    assert bool(Text.of("x")) and not Text.of("")


def test_a_line_takes_2000_characters_also_by_replacement() -> None:
    line = Text.of("x" * 10)
    assert len(line.replace(0, 1, "y" * (MAX_LINE - 9)).chars) == MAX_LINE
    with pytest.raises(SourceError, match="more than 2000 characters") as caught:
        line.replace(4, 5, "y" * (MAX_LINE - 8))
    assert caught.value.column == 5


@pytest.mark.parametrize(
    ("line", "rest", "parts"),
    [
        ("a, b ; c, d", "a, b ", ["a", "b"]), ("dt ';', 1 ; x", "dt ';', 1 ", ["dt ';'", "1"]),
        ('dt "a;b,c", 2', 'dt "a;b,c", 2', ['dt "a;b,c"', "2"]), (";", "", [""]),
        ("a,,b", "a,,b", ["a", "", "b"]),
        ('"\\";" ; x', '"\\";" ', ['"\\";"']), ('"open ; not', '"open ; not', ['"open ; not']),
        ("A';' ; c", "A';' ", ["A';'"]),
    ],
)  # fmt: skip
def test_comments_and_commas_in_strings_are_neither(line: str, rest: str, parts: list[str]) -> None:
    text = Text.of(line)
    assert text.without_comment().chars == rest
    assert [part.chars for part in text.without_comment().split(",")] == parts


@pytest.mark.parametrize(
    ("line", "column"),
    [('a "b"', None), ('a "b', 3), ('"', 1), ('""', None), ('"a" "', 5), ('"a\\"', 1), ("'\"'", None)],
)
def test_a_quote_that_is_not_closed_has_its_column(line: str, column: int | None) -> None:
    assert Text.of(line).unclosed() == column


@pytest.mark.parametrize(
    ("text", "radix", "expected"),
    [
        ("10 1f .10", 16, [("number", 1, 16), ("number", 4, 31), ("number", 7, 10)]),
        ("10b 10o 10q 10d 10h", 10, [("number", 1, 2), ("number", 5, 8), ("number", 9, 8), ("number", 13, 10),
                                     ("number", 17, 16)]),
        ("10b 10d 1h", 16, [("number", 1, 0x10B), ("number", 5, 0x10D), ("number", 9, 1)]),
        ("17 0x17 B'11' o'17' Q'17' D'19' h'1f'", 8,
         [("number", 1, 15), ("number", 4, 23), ("number", 9, 3), ("number", 15, 15), ("number", 21, 15),
          ("number", 27, 19), ("number", 33, 31)]),
        ("'a' A'b' '\\n' '\\x41' '\\101' '\\'' '\\0'", 16,
         [("number", 1, 97), ("number", 5, 98), ("number", 10, 10), ("number", 15, 65), ("number", 22, 65),
          ("number", 29, 39), ("number", 34, 0)]),
        ("D'-5'", 16, [("number", 1, -5)]),
        ("a<<b>=c&&d", 16, [("name", 1, 0), ("operator", 2, 0), ("name", 4, 0), ("operator", 5, 0),
                            ("name", 7, 0),
                            ("operator", 8, 0), ("name", 10, 0)]),
        ('"s t" $ .name', 16, [("string", 1, 0), ("operator", 7, 0), ("name", 9, 0)]),
        ("b", 2, [("name", 1, 0)]),
    ],
)  # fmt: skip
def test_tokens_have_their_kind_column_and_value(
    text: str, radix: int, expected: list[tuple[str, int, int]]
) -> None:
    assert [(token.kind, token.column, token.value) for token in tokens(Text.of(text), radix)] == expected


@pytest.mark.parametrize(
    ("text", "radix", "column", "message"),
    [
        ("1 12", 2, 3, "'12' is not a binary number"), ("8", 8, 1, "'8' is not an octal number"),
        ("1a", 10, 1, "'1a' is not a decimal number"), ("0xG", 10, 1, "'G' is not a hexadecimal number"),
        ("  #", 10, 3, "illegal character '#'"), ("x 'ab", 10, 3, "the quote ' is not closed"),
    ],
)  # fmt: skip
def test_what_is_no_token_has_its_column(text: str, radix: int, column: int, message: str) -> None:
    with pytest.raises(SourceError) as caught:
        tokens(Text.of(text), radix)
    assert (caught.value.column, caught.value.text) == (column, message)


def test_escapes_in_strings() -> None:
    codes = {"\\0": 0, "\\a": 7, "\\b": 8, "\\t": 9, "\\n": 10, "\\v": 11, "\\f": 12, "\\r": 13, "\\q": 113}
    for body, code in codes.items():
        assert characters(f"x{body}y") == (120, code, 121)
    assert characters("\\x7F\\377\\777\\xZZ") == (0x7F, 0xFF, 0xFF, 120, 90, 90)
    assert characters("ÿŁ") == (0xFF, 0x41), "8 bits each"


class Words:
    def is_operation(self, word: str) -> bool:
        return word.lower() in ("nop", "goto", "equ", "set", "macro")

    def is_almost_operation(self, word: str) -> bool:
        return word == "nopp"


@pytest.mark.parametrize(
    ("line", "label", "word", "column", "rest"),
    [
        ("nop", None, "nop", 1, ""), ("  goto x ; y", None, "goto", 3, "x"),
        ("a nop", ("a", 1), "nop", 3, ""),
        ("a: nop", ("a", 1), "nop", 4, ""), ("  a: nop", ("a", 3), "nop", 6, ""),
        ("a", ("a", 1), "", 1, ""),
        ("  a", ("a", 3), "", 1, ""), ("  nopp", None, "nopp", 3, ""), ("  a nop", ("a", 3), "nop", 5, ""),
        ("  a b", None, "a", 3, "b"), ("a equ 3", ("a", 1), "equ", 3, "3"), ("a = 3", ("a", 1), "=", 3, "3"),
        ("a == 3", ("a", 1), "", 0, ""), ("a += 3", ("a", 1), "+=", 3, "3"), ("a++", ("a", 1), "++", 2, ""),
        ("a <<= 2", ("a", 1), "<<=", 3, "2"), ("", None, "", 1, ""), ("; x", None, "", 1, ""),
        ("#define x", None, "#define", 1, "x"), ("nop equ 1", ("nop", 1), "equ", 5, "1"),
    ],
)  # fmt: skip
def test_a_statement_is_label_operation_and_operands(
    line: str, label: tuple[str, int] | None, word: str, column: int, rest: str
) -> None:
    if line == "a == 3":
        with pytest.raises(SourceError, match="'=' is not expected here"):
            statement(SourceLine(Text.of(line), "f", 1), Words())
        return
    found = statement(SourceLine(Text.of(line), "f", 7), Words())
    assert (found.label, found.word, found.rest.chars) == (label and label[0], word, rest)
    assert found.label_column == (label[1] if label else 1)
    if word:
        assert (found.column, found.place.line, found.place.column) == (column, 7, column)


def test_lines_are_numbered_from_1() -> None:
    assert [(line.text.chars, line.number) for line in lines_of("a\r\nb\rc\nd\f\n", "f")] == [
        ("a", 1), ("b", 2), ("c", 3), ("d", 4), ("", 5)
    ]  # fmt: skip
    assert [line.text.chars for line in lines_of("a\nb\x1ac\nd", "f")] == ["a", "b"]


def test_names_are_replaced_outside_strings_and_comments() -> None:
    definitions = {
        "A": Definition("1+B"), "B": Definition("2"), "C": Definition("C"),
        "F": Definition("(x*y)", ("x", "y")),
    }  # fmt: skip
    counted = 0

    def spend() -> None:
        nonlocal counted
        counted += 1

    def replaced(line: str) -> str:
        return substitute(Text.of(line), definitions, spend).chars

    assert replaced('movlw A ; A "A"') == 'movlw 1+2 ; A "A"'
    assert counted == 2
    assert replaced("dt \"A\", A, AB, A1, b'A'") == "dt \"A\", 1+2, AB, A1, b'A'"
    assert replaced("movlw F(1, A)") == "movlw (1*1+2)"
    assert replaced("movlw F((1,2), 3)") == "movlw ((1,2)*3)"
    assert replaced("movlw F 1, 2") == "movlw (1*2)"
    assert replaced("movlw F(1)") == "movlw F(1)", "another number of arguments"
    assert replaced("movlw C + A") == "movlw C + 1+2"
    for kept in ("#define A 3", " ifdef A", "#undefine A", "ifndef A"):
        assert replaced(kept) == kept
    assert columns(substitute(Text.of("a A b"), definitions, spend))[2:5] == [("1", 3), ("+", 3), ("2", 3)]
    assert parameters(Text.of("movlw p+q, 'p'"), {"p": "q", "q": "r"}).chars == "movlw q+r, 'p'"


def test_a_value_is_pasted_in_decimal() -> None:
    def value(text: Text) -> int:
        return len(text.chars)

    assert paste(Text.of("a#v(xyz)b #v((1)) ; #v(x)"), value).chars == "a3b 3 ; #v(x)"
    assert paste(Text.of("#define a #v(x)"), value).chars == "#define a #v(x)"
    with pytest.raises(SourceError, match=r"unmatched \(") as caught:
        paste(Text.of("ab#v(x"), value)
    assert caught.value.column == 5


def test_names_of_macro_calls_are_found_again_in_the_second_pass() -> None:
    symbols = Symbols()
    symbols.define("a", 1, "label", 1)
    for value in (5, 6):
        symbols.enter()
        symbols.declare_local("x")
        assert symbols.is_local("x") and not symbols.defined("x")
        symbols.define("x", value, "label", 1)
        assert "x" in list(symbols.names())
        symbols.leave()
    assert (symbols.defined("x"), symbols.in_pass, symbols.addresses()) == (False, 1, {"a": 1})
    symbols.second_pass()
    assert symbols.in_pass == 2
    for value in (5, 6):
        symbols.enter()
        found = symbols.find("x")
        assert found is not None and (found.value, found.in_pass) == (value, 1)
        symbols.leave()
    with pytest.raises(SourceError, match="'a' is 0x1 in pass 1, 0x2 in pass 2") as caught:
        symbols.define("a", 2, "label", 9)
    assert (caught.value.code, caught.value.column) == ("asm-phase", 9)
    with pytest.raises(SourceError, match="'a' is defined already, as 0x2"):
        symbols.define("a", 3, "constant", 1)
    symbols.define("a", -1, "variable", 1)
    assert symbols.addresses() == {}
