"""The tokens of an operand: numbers in every MPASM notation, names, strings, operators.

In: a `Text` and the default radix. Out: a tuple of `Token`. Number notations: MPASM User's Guide DS33014,
section "Radix and numerical constants".
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.text import IDENTIFIER, Text

Kind = Literal["number", "name", "string", "operator"]


@dataclass(frozen=True, slots=True)
class Token:
    kind: Kind
    text: str
    column: int
    value: int = 0


_OPERATOR = re.compile(r"<<|>>|>=|<=|<>|==|!=|&&|\|\||[-+*/%&|^~!<>=()\[\],:$]")
_QUOTED_NUMBER = re.compile(r"([bodhqBODHQ])'(-?[0-9A-Za-z]+)'")
_CHARACTER = re.compile(r"[aA]?'(\\x[0-9A-Fa-f]{2}|\\[0-7]{3}|\\.|[^'])'")
_STRING = re.compile(r'"((?:\\.|[^"\\])*)(?:"|$)')
"""A string whose last quote is missing goes to the end of the line, as in MPASM, which warns of it."""

_PREFIXED = re.compile(r"0[xX]([0-9A-Za-z]+)")
_DECIMAL = re.compile(r"\.([0-9]+)")
_PLAIN = re.compile(r"[0-9][0-9A-Za-z]*")
_BINARY = re.compile(r"0[bB][01]+")
"""As pic-as takes it: MPASM knows no such number. `0B5h` and `0B` are numbers with suffixes to both."""
_ESCAPE = re.compile(r"\\(x[0-9A-Fa-f]{2}|[0-7]{3}|.)")

QUOTED_RADIX = {"B": 2, "O": 8, "Q": 8, "D": 10, "H": 16}
SUFFIX_RADIX = {"B": 2, "O": 8, "Q": 8, "D": 10, "H": 16}
ESCAPES = {"0": 0, "a": 7, "b": 8, "t": 9, "n": 10, "v": 11, "f": 12, "r": 13}


def tokens(text: Text, radix: int) -> tuple[Token, ...]:
    """Return the tokens of an operand field. Raises SourceError at a character that starts no token."""
    scanned: list[Token] = []
    index = 0
    while index < len(text.chars):
        if text.chars[index].isspace():
            index += 1
            continue
        token, index = _token(text, index, radix)
        scanned.append(token)
    return tuple(scanned)


def characters(body: str) -> tuple[int, ...]:
    """Return the character codes of a string's body, 8 bits each, with its escapes (\\n, \\x41, \\101)
    resolved.
    """
    codes: list[int] = []
    index = 0
    while index < len(body):
        escape = _ESCAPE.match(body, index)
        codes.append(_escape(escape[1]) if escape else ord(body[index]) & 0xFF)
        index = escape.end() if escape else index + 1
    return tuple(codes)


def _escape(body: str) -> int:
    if body[0] == "x" and len(body) == 3:
        return int(body[1:], 16)
    if len(body) == 3:
        return int(body, 8) & 0xFF
    return ESCAPES.get(body, ord(body) & 0xFF)


def _token(text: Text, index: int, radix: int) -> tuple[Token, int]:
    chars, column = text.chars, text.column(index)

    def number(value: int, end: int) -> tuple[Token, int]:
        return Token("number", chars[index:end], column, value), end

    # most tokens are names; a letter in front of a quote belongs to a number or a character
    match = IDENTIFIER.match(chars, index)
    if match and not chars.startswith("'", match.end()):
        return Token("name", match[0], column), match.end()
    if match := _QUOTED_NUMBER.match(chars, index):
        return number(_digits(match[2], QUOTED_RADIX[match[1].upper()], column), match.end())
    if match := _CHARACTER.match(chars, index):
        return number(characters(match[1])[0], match.end())
    if match := _STRING.match(chars, index):
        return Token("string", match[1], column), match.end()
    if match := _PREFIXED.match(chars, index):
        return number(_digits(match[1], 16, column), match.end())
    if match := _DECIMAL.match(chars, index):
        return number(int(match[1]), match.end())
    if match := IDENTIFIER.match(chars, index):
        return Token("name", match[0], column), match.end()
    if match := _PLAIN.match(chars, index):
        return number(_plain(match[0], radix, column), match.end())
    if match := _OPERATOR.match(chars, index):
        return Token("operator", match[0], column), match.end()
    if chars[index] in "\"'":
        raise SourceError("asm-syntax", f"the quote {chars[index]} is not closed", column)
    raise SourceError("asm-syntax", f"illegal character '{chars[index]}'", column)


def _plain(word: str, radix: int, column: int) -> int:
    """Return a number with a suffix or in the default radix; in hexadecimal, a last B or D is a digit."""
    if radix == 10 and _BINARY.fullmatch(word):
        return _digits(word[2:], 2, column)
    suffix = word[-1].upper()
    if suffix in SUFFIX_RADIX and len(word) > 1 and not (radix == 16 and suffix in "BD"):
        return _digits(word[:-1], SUFFIX_RADIX[suffix], column)
    return _digits(word, radix, column)


def _digits(word: str, radix: int, column: int) -> int:
    try:
        return int(word, radix)
    except ValueError:
        names = {2: "a binary", 8: "an octal", 10: "a decimal", 16: "a hexadecimal"}
        raise SourceError("asm-syntax", f"'{word}' is not {names[radix]} number", column) from None
