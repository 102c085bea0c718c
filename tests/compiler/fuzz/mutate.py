"""Broken programs: whole ones with tokens or bytes taken out, doubled, exchanged or put in.

In: the C files of the tests, and a seed. Out: a text and the dialect in which it is to be compiled; the
same seed, the same text.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

TESTS = Path(__file__).parents[2]
DIALECTS = ("c2c", "xc8", "sdcc")
_TOKEN = re.compile(
    r"\s+|[A-Za-z_]\w*|0[xXbB]\w+|\d\w*|\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*'|[-+*/%&|^<>=!]=|&&|\|\||<<=?|>>=?|->|\+\+|--|.",
    re.S,
)
_SPICE = [
    "{", "}", "(", ")", "[", "]", ";", ",", ":", "?", "=", "==", "!=", "<", ">", "<=", ">=", "+", "-", "*",
    "/", "%", "&", "&&", "|", "||", "^", "~", "!", "<<", ">>", "++", "--", ".", "->", "+=", "<<=", "@", "#",
    "##", "\\", '"', "'", "//", "/*", "*/", "if", "else", "while", "for", "do", "switch", "case", "default",
    "break", "continue", "goto", "return", "sizeof", "struct", "union", "enum", "typedef", "static", "const",
    "volatile", "extern", "void", "char", "int", "unsigned", "signed", "long", "short", "bit", "bool",
    "float", "interrupt", "__interrupt", "__at", "asm", "_asm", "#asm", "#endasm", "#if", "#ifdef", "#endif",
    "#else", "#define", "#include", "#pragma", "#error", "main", "PORTB", "TRISB", "STATUS", "INTCON", "RB0",
    "GIE", "NULL", "set_bit", "delay_ms", "__delay_ms", "_delay", "putchar", "getchar", "eeprom_write",
    "__EEPROM_DATA", "__CONFIG", "0", "1", "-1", "7", "8", "255", "256", "32767", "32768", "65535", "65536",
    "0xFFFFFFFF", "4294967296", "99999999999999", "0x", "0b", "0b102", "00010000b", "08", "1e5", "1.5", "'a'",
    "''", "'ab'", '""', '"x\\ny"', "\x00", "\t", "\r", "\n", "é", "€",
]  # fmt: skip
_NESTED = (
    "(", "{", "[", "-", "!", "~", "*", "a.", "a[", "f(", "1+", "1?", "1?1:", "x=", "if(1)", "{;", "(char)",
    "a,", "\\", "#if 1\n",
)  # fmt: skip
"""Each alone, many times over, makes something deep or long."""


@dataclass(frozen=True)
class Corpus:
    """Texts with their dialects, and all their tokens to draw from."""

    texts: tuple[tuple[str, str], ...]
    words: tuple[str, ...]

    @staticmethod
    @cache
    def of_tests() -> Corpus:
        """The C files of the tests, in order of their names."""
        found = []
        for path in sorted(TESTS.rglob("*.c")):
            text = path.read_text()
            stated = re.search(r"^// dialect: (\w+)", text, re.MULTILINE)
            named = next((each for each in DIALECTS if each in str(path.relative_to(TESTS))), "c2c")
            found.append((text, stated[1] if stated else named))
        words = sorted({token for text, _ in found for token in _TOKEN.findall(text) if not token.isspace()})
        return Corpus(tuple(found), tuple(words))

    def mutated(self, seed: int) -> tuple[str, str]:
        dice = random.Random(seed)
        text, dialect = dice.choice(self.texts)
        if dice.random() < 0.1:
            dialect = dice.choice(DIALECTS)
        rounds = dice.choice((1, 1, 1, 2, 3, 5, 10, 30))
        if dice.random() < 0.75:
            tokens = _TOKEN.findall(text)
            for _ in range(rounds):
                self._token(tokens, dice)
            return "".join(tokens), dialect
        for _ in range(rounds):
            text = _byte(text, dice)
        return text, dialect

    def _token(self, tokens: list[str], dice: random.Random) -> None:
        if not tokens:
            tokens.append(dice.choice(_SPICE))
        at = dice.randrange(len(tokens))
        match dice.randrange(10):
            case 0:
                del tokens[at]
            case 1:
                tokens.insert(at, tokens[at])
            case 2 | 3:
                tokens[at] = dice.choice(self.words)
            case 4:
                tokens[at] = dice.choice(_SPICE)
            case 5:
                tokens.insert(at, f" {dice.choice(_SPICE)} ")
            case 6:
                other = dice.randrange(len(tokens))
                tokens[at], tokens[other] = tokens[other], tokens[at]
            case 7:
                end = min(len(tokens), at + dice.randrange(1, 30))
                part = tokens[at:end]
                to = dice.randrange(len(tokens))
                tokens[to:to] = part
            case 8:
                del tokens[at : at + dice.randrange(1, 30)]
            case 9 if dice.random() < 0.2:
                tokens.insert(at, dice.choice(_NESTED) * dice.choice((3, 30, 300, 3000)))


def _byte(text: str, dice: random.Random) -> str:
    if not text:
        return dice.choice(_SPICE)
    at = dice.randrange(len(text))
    match dice.randrange(4):
        case 0:
            return text[:at] + text[at + 1 :]
        case 1:
            return text[:at] + chr(dice.randrange(256)) + text[at + 1 :]
        case 2:
            return (
                text[:at]
                + chr(dice.choice((0, 9, 10, 34, 39, 40, 41, 59, 92, 123, 125, 0x1F600)))
                + text[at:]
            )
    return text[:at] + chr(ord(text[at]) ^ 1 << dice.randrange(7)) + text[at + 1 :]
