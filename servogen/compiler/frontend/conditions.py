"""The value of the expression of an `#if` (ISO C 6.10.1): integers of 64 bits, signed or not."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from servogen.compiler.frontend.assembly import plain_numbers

_BITS = 64
_LEVELS = ("||", "&&", "|", "^", "&", "== !=", "< > <= >=", "<< >>", "+ -", "* / %")
"""The binary operators, those that bind least first."""
_LEVEL = {operator: level for level, operators in enumerate(_LEVELS) for operator in operators.split()}
_ESCAPES = {"n": 10, "t": 9, "r": 13, "a": 7, "b": 8, "f": 12, "v": 11, "\\": 92, "'": 39, '"': 34, "?": 63}


@dataclass(frozen=True)
class IntegerValue:
    """A value; `unsigned` decides how the operators take it."""

    value: int
    unsigned: bool = False


def _wrapped(value: int, *, unsigned: bool) -> IntegerValue:
    value &= (1 << _BITS) - 1
    return IntegerValue(value if unsigned or value < 1 << _BITS - 1 else value - (1 << _BITS), unsigned)


def _quotient(a: int, b: int) -> int:
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


_ARITHMETIC: dict[str, Callable[[int, int], int]] = {
    "|": lambda a, b: a | b,
    "^": lambda a, b: a ^ b,
    "&": lambda a, b: a & b,
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _quotient,
    "%": lambda a, b: a - b * _quotient(a, b),
}
_RELATIONS: dict[str, Callable[[int, int], bool]] = {
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
}


class DirectiveCondition:
    """Reads the tokens of an expression from left to right. A ValueError says what is wrong with them."""

    def __init__(self, tokens: Sequence[str]) -> None:
        self._tokens = [*tokens, ""]
        self._at = 0

    def value(self) -> int:
        result = self._choice(live=True)
        if self._tokens[self._at]:
            raise ValueError(f"'{self._tokens[self._at]}' is not expected there")
        return result.value

    def _next(self) -> str:
        self._at += 1
        return self._tokens[self._at - 1]

    def _takes(self, text: str) -> bool:
        if self._tokens[self._at] != text:
            return False
        self._at += 1
        return True

    def _needs(self, text: str) -> None:
        if not self._takes(text):
            raise ValueError(f"'{text}' is missing")

    def _choice(self, *, live: bool) -> IntegerValue:
        """Read a conditional expression; in one that is not `live`, a division by zero does not count."""
        condition = self._binary(0, live=live)
        if not self._takes("?"):
            return condition
        yes = self._choice(live=live and condition.value != 0)
        self._needs(":")
        no = self._choice(live=live and condition.value == 0)
        unsigned = yes.unsigned or no.unsigned
        return _wrapped((yes if condition.value else no).value, unsigned=unsigned)

    def _binary(self, level: int, *, live: bool) -> IntegerValue:
        """Read the operators of a level of precedence and of those above it, from left to right."""
        if level == len(_LEVELS):
            return self._unary(live=live)
        left = self._binary(level + 1, live=live)
        while _LEVEL.get(self._tokens[self._at]) == level:
            operator = self._next()
            needed = {"&&": left.value != 0, "||": left.value == 0}.get(operator, True)
            left = _computed(operator, left, self._binary(level + 1, live=live and needed), live=live)
        return left

    def _unary(self, *, live: bool) -> IntegerValue:
        """Read an operand with the signs before it."""
        token = self._next()
        if token in ("+", "-", "~", "!"):
            operand = self._unary(live=live)
            if token == "!":
                return IntegerValue(int(not operand.value))
            value = {"+": operand.value, "-": -operand.value, "~": ~operand.value}[token]
            return _wrapped(value, unsigned=operand.unsigned)
        if token == "(":
            inner = self._choice(live=live)
            self._needs(")")
            return inner
        if re.match(r"[A-Za-z_]", token):
            # a name that is no macro is 0, with what looks like its arguments
            if self._tokens[self._at] == "(":
                self._skip()
            return IntegerValue(0)
        return _constant(token)

    def _skip(self) -> None:
        depth = 0
        while token := self._next():
            depth += {"(": 1, ")": -1}.get(token, 0)
            if depth == 0:
                return
        raise ValueError("')' is missing")


def _computed(operator: str, left: IntegerValue, right: IntegerValue, *, live: bool) -> IntegerValue:
    """Return the value of a binary operator (ISO C99 6.10.1, 6.3.1.8). Raises ValueError."""
    a, b = left.value, right.value
    if operator in ("&&", "||"):
        return IntegerValue(int(bool(a and b) if operator == "&&" else bool(a or b)))
    if operator in ("<<", ">>"):
        bits = b if 0 <= b < _BITS else _BITS
        return _wrapped(a << bits if operator == "<<" else a >> bits, unsigned=left.unsigned)
    unsigned = left.unsigned or right.unsigned
    a, b = (_wrapped(value, unsigned=unsigned).value for value in (a, b))
    if operator in _RELATIONS:
        return IntegerValue(int(_RELATIONS[operator](a, b)))
    if operator in ("/", "%") and not b:
        if live:
            raise ValueError("it divides by zero")
        return IntegerValue(0, unsigned)
    return _wrapped(_ARITHMETIC[operator](a, b), unsigned=unsigned)


def _constant(token: str) -> IntegerValue:
    """Return the value of an integer or of a character."""
    if match := re.fullmatch(r"'(?:([^'\\])|\\([0-7]{1,3})|\\x([0-9a-fA-F]+)|\\(.))'", token):
        plain, octal, hexadecimal, simple = match.groups()
        if simple:
            if simple not in _ESCAPES:
                raise ValueError(f"{token} is no character")
            return IntegerValue(_ESCAPES[simple])
        return IntegerValue(
            ord(plain) & 0xFF if plain else int(octal or hexadecimal, 8 if octal else 16) & 0xFF
        )
    digits = plain_numbers(token)
    if not re.fullmatch(r"0[xX][0-9a-fA-F]+|0[0-7]*|[1-9]\d*", digits):
        raise ValueError(f"'{token}' is no integer" if token else "an operand is missing")
    value = int(digits, 8 if re.fullmatch("0[0-7]+", digits) else 0)
    if value >= 1 << _BITS:
        raise ValueError(f"'{token}' has more than {_BITS} bits")
    suffixed = re.search(r"[uU][lL]*$", token) is not None
    return _wrapped(value, unsigned=suffixed or value >= 1 << _BITS - 1)
