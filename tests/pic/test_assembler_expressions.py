"""Numbers and expressions, by hand from the MPASM User's Guide DS33014 (radix; operators and precedence)."""

from __future__ import annotations

from typing import Any

import pytest


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1F", 0x1F),  # the default radix is hexadecimal
        ("10", 0x10), ("0x1F", 0x1F), ("0X1f", 0x1F), ("1Fh", 0x1F), ("0FFh", 0xFF), ("H'1F'", 0x1F),
        ("h'1f'", 0x1F), ("D'31'", 31), ("d'-1'", 0xFF), (".31", 31), ("B'0101'", 5), ("b'10000001'", 0x81),
        ("O'17'", 15), ("Q'17'", 15), ("17o", 15), ("17q", 15), ("A'c'", 0x63), ("'c'", 0x63), ("' '", 0x20),
        ("';'", 0x3B), ("','", 0x2C), ("'\\n'", 10), ("'\\''", 0x27), ("'\\x41'", 0x41), ('"a"', 0x61),
        ("1b", 0x1B),  # in hexadecimal, b and d at the end are digits
        ("1d", 0x1D),
    ],
)  # fmt: skip
def test_every_notation_of_a_number(asm: Any, text: str, expected: int) -> None:
    assert asm.value(text) == expected


@pytest.mark.parametrize(
    ("radix", "text", "expected"),
    [
        ("dec", "10", 10), ("dec", "101b", 5), ("dec", "10d", 10), ("dec", "0x10", 16), ("oct", "17", 15),
        ("hex", "17", 23), ("dec", "0B5h", 0xB5), ("dec", "0b1h", 0xB1), ("dec", "0b", 0),
        ("dec", "0b101", 5),
    ],
)  # fmt: skip
def test_the_default_radix_can_be_chosen(asm: Any, radix: str, text: str, expected: int) -> None:
    assert asm.value(text, before=f" radix {radix}") == expected
    assert asm.value(text, before=f" list r={radix}") == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2+3*4", 14), ("(2+3)*4", 20), (".10-3-2", 5), (".20/3", 6), ("-.20/3", 0xFA), ("-.20%3", 0xFE),
        ("1<<2+1", 8), ("1<<2<<1", 8), ("1<<.32", 0), ("1<<-1", 0), ("-5>>1", 0xFD), ("-5>>.100", 0xFF),
        ("0x80>>3", 0x10), ("6&3|8", 0x0A), ("1|2^3", 0),  # one level, from the left: (1|2)^3
        ("4&6==6", 0),  # a comparison binds tighter: 4&1
        ("(4&6)==4", 1), ("3<4==1", 1), ("5>=5", 1), ("5<=4", 0), ("5!=4", 1), ("1||0&&0", 1), ("!0", 1),
        ("!5", 0), ("~0x0F", 0xF0), ("-1", 0xFF), ("+3", 3), ("-(3)", 0xFD), ("high 0x1234", 0x12),
        ("low 0x1234", 0x34), ("upper 0x123456", 0x12), ("high 0x10FF+1", 0x11),  # high binds first: 0x10+1
        ("high (0x10FF+1)", 0x11), ("low 0x10FF+1", 0x00), ("HIGH(0x1234)", 0x12),
    ],
)  # fmt: skip
def test_operators_and_their_precedence(asm: Any, text: str, expected: int) -> None:
    assert asm.value(text) == expected


def test_high_binds_tighter_than_plus(asm: Any) -> None:
    assert asm.words(" dw high 0x1280+0x80") == [0x92]
    assert asm.words(" dw high (0x1280+0x80)") == [0x13]


def test_values_have_32_bits(asm: Any) -> None:
    assert asm.value("(0x7FFFFFFF+1)>>.31") == 0xFF
    assert asm.value("0xFFFFFFFF == -1") == 1


def test_dollar_is_the_address_of_the_instruction(asm: Any) -> None:
    assert asm.words(" nop\n goto $\n goto $-1\n goto $+2") == [0, 0x2801, 0x2801, 0x2805]


@pytest.mark.parametrize(
    ("operand", "expected"),
    [
        ("1+", "1:10 128 an operand is missing here"),
        ("(1+2", "1:8 107 unmatched ("),
        ("1)", "1:9 101 ')' is not expected here"),
        ("1 2", "1:10 101 '2' is not expected here"),
        ("1/0", "1:9 114 divide by zero"),
        ("1%0", "1:9 114 divide by zero"),
        ("b'12'", "1:8 101 '12' is not a binary number"),
        ("1G", "1:8 101 '1G' is not a hexadecimal number"),
        ("9o", "1:8 101 '9' is not an octal number"),
        ("'ab'", "1:8 101 the quote ' is not closed"),
        ('"ab"', '1:8 124 "ab" is a string where one value is expected'),
        ("1 \\ 2", "1:10 101 illegal character '\\'"),
        ("nowhere", "1:8 113 symbol not previously defined: 'nowhere'"),
    ],
)
def test_a_wrong_expression_is_shown_to_the_column(asm: Any, operand: str, expected: str) -> None:
    assert asm.errors(f" movlw {operand}\n end") == [expected]
