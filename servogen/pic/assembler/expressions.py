"""Expressions of MPASM: parsed into a tree, evaluated in 32-bit integers.

Precedence, tightest first (DS33014, section "Arithmetic operators and precedence"):

    high low upper - ! ~ +    unary
    * / %     + -     << >>     < > <= >= == !=     & | ^     &&     ||

Note that a comparison binds tighter than &, | and ^.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from servogen.errors import did_you_mean
from servogen.pic.assembler.lexer import Token, characters, tokens
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.text import Text


@dataclass(frozen=True, slots=True)
class Number:
    value: int
    column: int = 1


@dataclass(frozen=True, slots=True)
class Name:
    name: str
    column: int = 1


@dataclass(frozen=True, slots=True)
class Here:
    """`$`: the address of the current instruction."""

    column: int = 1


@dataclass(frozen=True, slots=True)
class String:
    body: str
    column: int = 1

    @property
    def codes(self) -> tuple[int, ...]:
        return characters(self.body)


@dataclass(frozen=True, slots=True)
class UnaryOperation:
    operator: str
    operand: Expression
    column: int = 1


@dataclass(frozen=True, slots=True)
class BinaryOperation:
    operator: str
    left: Expression
    right: Expression
    column: int = 1


Expression = Number | Name | Here | String | UnaryOperation | BinaryOperation


class SymbolScope(Protocol):
    """The names that an expression can refer to."""

    def value(self, name: str) -> int | None:
        """Return the value of a name; None if it has none."""
        ...

    def hint(self, name: str) -> str | None:
        """Return a hint for a name without a value."""
        ...

    @property
    def here(self) -> int: ...


UNARY: Mapping[str, Callable[[int], int]] = {
    "-": operator.neg,
    "+": operator.pos,
    "~": operator.invert,
    "!": lambda value: int(value == 0),
    "high": lambda value: value >> 8 & 0xFF,
    "low": lambda value: value & 0xFF,
    "upper": lambda value: value >> 16 & 0xFF,
}


def _quotient(left: int, right: int) -> int:
    """Return the quotient as in C, rounded towards zero."""
    size = abs(left) // abs(right)
    return size if (left < 0) == (right < 0) else -size


def _sign(value: int) -> int:
    """Return the result of a shift by 32 or more, or by less than 0, as gpasm defines it; MPASM leaves it
    undefined.
    """
    return -1 if value < 0 else 0


BINARY: Mapping[str, tuple[int, Callable[[int, int], int]]] = {
    "*": (7, operator.mul),
    "/": (7, _quotient),
    "%": (7, lambda left, right: left - right * _quotient(left, right)),
    "+": (6, operator.add),
    "-": (6, operator.sub),
    "<<": (5, lambda left, right: left << right if 0 <= right < 32 else _sign(left)),
    ">>": (5, lambda left, right: left >> right if 0 <= right < 32 else _sign(left)),
    "<": (4, lambda left, right: int(left < right)),
    ">": (4, lambda left, right: int(left > right)),
    "<=": (4, lambda left, right: int(left <= right)),
    ">=": (4, lambda left, right: int(left >= right)),
    "==": (4, lambda left, right: int(left == right)),
    "!=": (4, lambda left, right: int(left != right)),
    "<>": (4, lambda left, right: int(left != right)),  # pic-as's
    "&": (3, operator.and_),
    "|": (3, operator.or_),
    "^": (3, operator.xor),
    "&&": (2, lambda left, right: int(bool(left and right))),
    "||": (1, lambda left, right: int(bool(left or right))),
}
"""Binding strength (higher is tighter) and meaning of each binary operator."""
_TIGHTEST = 8
"""The binding strength of a unary operator."""


MAX_DEPTH = 50
"""The maximum nesting of brackets and signs."""

MAX_OPERATORS = 200
"""The maximum number of operators in the fields of a line; each one is a level of the tree."""


class Parser:
    """Parses expressions from tokens; the fields between commas are separate expressions."""

    def __init__(self, scanned: tuple[Token, ...], end_column: int) -> None:
        self._tokens = scanned
        self._index = 0
        self._end_column = end_column
        self._depth = 0
        self._operators = 0

    @classmethod
    def of(cls, text: Text, radix: int) -> Parser:
        return cls(tokens(text, radix), text.column(len(text.chars)))

    def at_end(self) -> bool:
        return self._index >= len(self._tokens)

    def take(self, sign: str) -> bool:
        """Consume the next token if it is this operator, and return whether it was."""
        token = self._peek()
        if token is not None and token.kind == "operator" and token.text == sign:
            self._index += 1
            return True
        return False

    def fields(self) -> tuple[Expression | None, ...]:
        """Return the expressions between commas up to the end of the line; None for an empty field."""
        if self.at_end():
            return ()
        expressions: list[Expression | None] = []
        while True:
            token = self._peek()
            empty = token is None or (token.kind == "operator" and token.text == ",")
            expressions.append(None if empty else self.expression())
            if self.at_end():
                return tuple(expressions)
            if not self.take(","):
                raise self._unexpected()

    def expression(self, weakest: int = 1) -> Expression:
        left = self._operand()
        while True:
            token = self._peek()
            if token is None or token.kind != "operator" or token.text not in BINARY:
                return left
            strength = BINARY[token.text][0]
            if strength < weakest:
                return left
            self._index += 1
            self._operators += 1
            if self._operators > MAX_OPERATORS:
                raise SourceError(
                    "asm-syntax", f"more than {MAX_OPERATORS} operators in a line", token.column
                )
            # Precedence climbing: the right side takes only operators that bind tighter, so equal ones group
            # to the left.
            left = BinaryOperation(token.text, left, self.expression(strength + 1), token.column)

    def _operand(self) -> Expression:
        self._depth += 1
        try:
            return self._operand_within()
        finally:
            self._depth -= 1

    def _operand_within(self) -> Expression:
        token = self._peek()
        if self._depth > MAX_DEPTH:
            raise SourceError(
                "asm-syntax", "the expression is nested too deeply", token.column if token else None
            )
        if token is None:
            raise SourceError("asm-missing-argument", "an operand is missing here", self._end_column)
        self._index += 1
        if token.kind == "number":
            return Number(token.value, token.column)
        if token.kind == "string":
            return String(token.text, token.column)
        word = token.text.lower()
        if word in UNARY:
            return UnaryOperation(word, self._operand(), token.column)
        if token.kind == "name":
            return Name(token.text, token.column)
        if token.text == "$":
            return Here(token.column)
        if token.text in "([":
            inner = self.expression()
            if not self.take(")" if token.text == "(" else "]"):
                raise SourceError("asm-parenthesis", f"unmatched {token.text}", token.column)
            return inner
        self._index -= 1
        raise self._unexpected()

    def _peek(self) -> Token | None:
        return None if self.at_end() else self._tokens[self._index]

    def _unexpected(self) -> SourceError:
        token = self._tokens[self._index]
        return SourceError("asm-syntax", f"'{token.text}' is not expected here", token.column)


def parse_expression(text: Text, radix: int) -> Expression:
    """Return the single expression in a text. Raises SourceError."""
    parser = Parser.of(text, radix)
    expression = parser.expression()
    if not parser.at_end():
        raise parser._unexpected()
    return expression


def suggestion(word: str, known: Iterable[str]) -> str | None:
    """Return the most similar known word as a hint; None if none is similar."""
    hint = did_you_mean(word, known)
    return hint if hint.startswith("did") else None


def spelling(expression: Expression, weakest: int = 0) -> str:
    """Return an expression as text, for messages; numbers are decimal. It is in parentheses if an operator
    in it binds less tightly than `weakest`.
    """
    match expression:
        case Number(value):
            return str(value)
        case Name(name):
            return name
        case Here():
            return "$"
        case String(body):
            return f'"{body}"'
        case UnaryOperation(sign, operand):
            return f"{sign}{' ' * sign.isalpha()}{spelling(operand, _TIGHTEST)}"
        case BinaryOperation(sign, left, right):
            strength = BINARY[sign][0]
            text = f"{spelling(left, strength)} {sign} {spelling(right, strength + 1)}"
            return f"({text})" if strength < weakest else text


def evaluate(expression: Expression, scope: SymbolScope) -> int:
    """Return the value as a signed 32-bit integer, as MPASM computes. Raises SourceError with the column."""
    match expression:
        case Number(value):
            return _wrap(value)
        case Here():
            return scope.here
        case String():
            return _character(expression)
        case Name(name, column):
            defined = scope.value(name)
            if defined is None:
                text = f"symbol not previously defined: '{name}'"
                raise SourceError("asm-undefined-symbol", text, column, scope.hint(name))
            return defined
        case UnaryOperation(sign, operand):
            return _wrap(UNARY[sign](evaluate(operand, scope)))
        case BinaryOperation(sign, left, right, column):
            values = evaluate(left, scope), evaluate(right, scope)
            if sign in "/%" and values[1] == 0:
                raise SourceError("asm-divide-by-zero", "divide by zero", column)
            return _wrap(BINARY[sign][1](*values))


def _character(string: String) -> int:
    if len(string.codes) != 1:
        raise SourceError(
            "asm-bad-argument", f'"{string.body}" is a string where one value is expected', string.column
        )
    return string.codes[0]


def _wrap(value: int) -> int:
    return (value + 0x80000000 & 0xFFFFFFFF) - 0x80000000
