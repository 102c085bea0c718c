"""Tokens to a syntax tree: pycparser's recursive descent, fed with tokens that keep their own places.

In: preprocessing tokens after the dialect's rewriting. Out: a pycparser tree. After a syntax error the parser
goes on at the next function, so that one run shows the errors of each.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NoReturn

from pycparser import c_lexer
from pycparser.c_parser import CParser, ParseError, _TokenStream

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.preprocess import PToken
from servogen.errors import Place

_INTEGER = re.compile(r"(?:0[xX][0-9a-fA-F]+|[0-9]+)([uUlL]*)")


@cache
def _punctuators() -> dict[str, str]:
    lexer = c_lexer.CLexer(_no_error)
    found = {}
    for text in [
        "...",
        "<<=",
        ">>=",
        "++",
        "--",
        "->",
        "&&",
        "||",
        "<<",
        ">>",
        "<=",
        ">=",
        "==",
        "!=",
        "*=",
        "/=",
        "%=",
        "+=",
        "-=",
        "&=",
        "|=",
        "^=",
        "=",
        "+",
        "-",
        "*",
        "/",
        "%",
        "|",
        "&",
        "~",
        "^",
        "!",
        "<",
        ">",
        "?",
        "(",
        ")",
        "[",
        "]",
        ",",
        ".",
        ";",
        ":",
        "{",
        "}",
    ]:
        lexer.input(text)
        token = lexer.token()
        found[text] = token.type if token else ""
    return found


def _no_error(message: str, line: int, column: int) -> None:
    raise ValueError(f"{line}:{column}: {message}")


@cache
def _keywords() -> dict[str, str]:
    unwanted = {"offsetof", "_Complex", "_Atomic", "_Thread_local", "__int128", "__builtin_va_arg"}
    return {
        word: kind for word, kind in c_lexer.CLexer(_no_error)._keyword_map.items() if word not in unwanted
    }


class _Feed:
    """Stands where pycparser's lexer would: hands out ready-made tokens."""

    def __init__(self, error_func: Callable[[str, int, int], None], *, dialect: str = "legacy") -> None:
        self.tokens: list[c_lexer.Token] = []
        self.filename = ""
        self._next = 0

    def input(self, text: str, filename: str = "") -> None:
        self._next = 0

    def token(self) -> c_lexer.Token | None:
        if self._next >= len(self.tokens):
            return None
        self._next += 1
        return self.tokens[self._next - 1]


class SyntaxFault(ParseError):  # type: ignore[misc]
    """A syntax error at a token, or at the end of the file."""

    def __init__(self, message: str, coord: Any) -> None:
        super().__init__(message)
        self.coord = coord


class _Parser(CParser):  # type: ignore[misc]
    def _parse_error(self, msg: str, coord: Any) -> NoReturn:
        raise SyntaxFault(msg, coord)

    def index(self) -> int:
        return int(self._tokens.mark())

    def units(
        self, tokens: list[c_lexer.Token], typedefs: Iterable[str], fault: Callable[..., int]
    ) -> list[Any]:
        """Parse the whole file; `fault` reports an error and says at which token to go on."""
        self.clex.tokens = tokens
        self._scope_stack = [dict.fromkeys(typedefs, True)]
        self._typedef_checked_token = None
        self._tokens = _TokenStream(self.clex.token)
        found: list[Any] = []
        while self._peek() is not None:
            start = self.index()
            try:
                found.extend(self._parse_external_declaration())
            except (ParseError, AssertionError, AttributeError, IndexError, TypeError) as error:
                # pycparser raises the last four on input that its grammar did not foresee
                del self._scope_stack[1:]
                self._typedef_checked_token = None
                self._tokens.reset(fault(error, start, self.index()))
        return found


def parse(tokens: list[PToken], typedefs: Iterable[str], reporter: Reporter) -> list[Any]:
    """The external declarations of a file. Syntax errors go to the reporter."""
    stream = [_token(each, reporter) for each in tokens]
    parser = _Parser(lexer=_Feed)

    def fault(error: Exception, start: int, at: int) -> int:
        _report(error, stream, tokens, start, at, reporter)
        return _resume(tokens, start, max(at, start + 1))

    return parser.units(stream, typedefs, fault)


def _token(token: PToken, reporter: Reporter) -> c_lexer.Token:
    text = token.text
    kind = _punctuators().get(text) or _keywords().get(text)
    if kind is None:
        if text[0] == '"':
            kind = "STRING_LITERAL"
        elif text[0] == "'":
            kind = "CHAR_CONST"
        elif re.fullmatch(r"[A-Za-z_$][\w$]*", text):
            kind = "ID"
        elif match := _INTEGER.fullmatch(text):
            kind = "INT_CONST_DEC"
            if match[1].lower() not in ("", "u", "l", "ul", "lu", "ll", "ull", "llu"):
                reporter.error(f"'{text}' is not a number: unknown suffix '{match[1]}'", token.place)
                text = "0"
            elif text[0] == "0" and text[1:2] not in ("x", "X") and re.search("[89]", text):
                reporter.error(f"'{text}' is not a number: octal digits are 0 to 7", token.place)
                text = "0"
        elif re.fullmatch(r"(\d+\.\d*|\.\d+|\d+)([eE][+-]?\d+)?[fFlL]?", text):
            reporter.error(
                f"'{text}': this compiler has no floating point", token.place, hint="use scaled integers"
            )
            kind, text = "INT_CONST_DEC", "0"
        elif text[0].isdigit():
            reporter.error(f"'{text}' is not a number", token.place)
            kind, text = "INT_CONST_DEC", "0"
        else:
            reporter.error(f"the character {text!r} has no meaning in C", token.place)
            kind, text = "SEMI", ";"
    place = token.place
    return c_lexer.Token(kind, text, place.line or 0, place.column or 0, place.file or "")


def place_of(coord: Any) -> Place:
    """The place of a pycparser coordinate."""
    if coord is None or isinstance(coord, str):
        return Place(coord or None)
    return Place(coord.file or None, coord.line or None, coord.column or None)


def _report(
    error: Exception,
    stream: list[c_lexer.Token],
    tokens: list[PToken],
    start: int,
    at: int,
    reporter: Reporter,
) -> None:
    """One sentence at the place where the parser stopped."""
    message = str(error)
    coord = getattr(error, "coord", None)
    index = _index_of(tokens, coord, start, at)
    missing = index > start and message.startswith("before:") and _wants_semicolon(tokens, index)
    if missing:
        before = tokens[index - 1]
        place = before.place
        if place.column:
            place = Place(place.file, place.line, place.column + len(before.text))
        reporter.error(f"syntax error: ';' is missing after '{before.text}'", place)
        return
    if index >= len(tokens):
        where = tokens[-1].place if tokens else Place()
        opened = _unclosed(tokens[start:])
        hint = f"the '{opened.text}' at {opened.place} is not closed" if opened else None
        reporter.error("syntax error: the file ends in the middle of a declaration", where, hint)
        return
    detail = (
        ""
        if message.startswith(("before:", "At end")) or not isinstance(error, SyntaxFault)
        else f" ({message[0].lower() + message[1:]})"
    )
    reporter.error(f"syntax error before '{tokens[index].text}'{detail}", tokens[index].place)


def _index_of(tokens: list[PToken], coord: Any, start: int, at: int) -> int:
    place = place_of(coord)
    if place.line is not None:
        for index in range(start, min(at + 2, len(tokens))):
            if tokens[index].place == place:
                return index
    return at


_ENDS = re.compile(r"[\w$)\]\"']$")
_STATEMENT_WORDS = frozenset(
    [
        "if",
        "while",
        "do",
        "for",
        "switch",
        "return",
        "break",
        "continue",
        "goto",
        "case",
        "default",
        "int",
        "char",
        "void",
        "unsigned",
        "signed",
        "long",
        "short",
        "const",
        "static",
        "struct",
        "union",
        "enum",
        "bit",
        "}",
    ]
)


def _wants_semicolon(tokens: list[PToken], index: int) -> bool:
    before, here = tokens[index - 1], tokens[index] if index < len(tokens) else None
    if here is None or not _ENDS.search(before.text) or before.text in _STATEMENT_WORDS:
        return False
    new_line = here.place.line != before.place.line
    return here.text in _STATEMENT_WORDS or (new_line and re.match(r"[A-Za-z_]", here.text) is not None)


def _unclosed(tokens: list[PToken]) -> PToken | None:
    stack: list[PToken] = []
    for token in tokens:
        if token.text in ("{", "(", "["):
            stack.append(token)
        elif token.text in ("}", ")", "]") and stack:
            stack.pop()
    return stack[0] if stack else None


def _resume(tokens: list[PToken], start: int, at: int) -> int:
    """The token after the declaration that holds token `at`: after its closing brace or semicolon."""
    depth = 0
    for index in range(start, len(tokens)):
        text = tokens[index].text
        if text == "{":
            depth += 1
        elif text == "}":
            depth = max(0, depth - 1)
            ended = depth == 0
            if ended and index >= at:
                return index + 1
        elif text == ";" and depth == 0 and index >= at:
            return index + 1
        elif (
            depth
            and index > at
            and tokens[index].place.column == 1
            and tokens[index - 1].text in ("}", ";")
            and text in ("void", "int", "char", "unsigned", "static", "main", "const")
        ):
            return index  # a brace was lost: a declaration in the first column starts anew
    return len(tokens)
