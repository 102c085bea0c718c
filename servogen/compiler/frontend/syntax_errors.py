"""Describes syntax errors, and finds where parsing resumes after one.

In: the tokens of a file and the parser's exception. Out: a diagnostic; the token of the next declaration.
"""

from __future__ import annotations

import re
from typing import Any

from pycparser.c_parser import ParseError

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.preprocessor import PToken
from servogen.errors import Location


class SyntaxFault(ParseError):  # type: ignore[misc]
    """A syntax error at a token, or at the end of the file."""

    def __init__(self, message: str, coord: Any) -> None:
        super().__init__(message)
        self.coord = coord


def place_of(coord: Any) -> Location:
    """Return the location of a pycparser coordinate."""
    if coord is None or isinstance(coord, str):
        return Location(coord or None)
    return Location(coord.file or None, coord.line or None, coord.column or None)


def report_syntax(
    error: Exception,
    tokens: list[PToken],
    start: int,
    stop: int,
    reporter: Reporter,
) -> None:
    """Report one sentence at the location where the parser stopped."""
    message = str(error)
    coord = getattr(error, "coord", None)
    index = _index_of(tokens, coord, start, stop)
    if index > start and message.startswith("before:"):
        ended = index if _wants_semicolon(tokens, start, index) else _unended(tokens, start, index)
        if ended is not None:
            before = tokens[ended - 1]
            place = before.place
            if place.column:
                place = Location(place.file, place.line, place.column + len(before.text))
            reporter.error("c-syntax", f"syntax error: ';' is missing after '{before.text}'", place)
            return
    if index >= len(tokens):
        where = tokens[-1].place if tokens else Location()
        opened = _unclosed(tokens[start:])
        hint = f"the '{opened.text}' at {opened.place} is not closed" if opened else None
        reporter.error("c-syntax", "syntax error: the file ends in the middle of a declaration", where, hint)
        return
    detail = (
        ""
        if message.startswith(("before:", "At end")) or not isinstance(error, SyntaxFault)
        else f" ({message[0].lower() + message[1:]})"
    )
    hint = _bracket_hint(tokens, start, index)
    reporter.error(
        "c-syntax", f"syntax error before '{tokens[index].text}'{detail}", tokens[index].place, hint
    )


def _index_of(tokens: list[PToken], coord: Any, start: int, stop: int) -> int:
    """Return the index of the token at pycparser's coordinate; `stop`, where the parser stands, if there is
    none.
    """
    place = place_of(coord)
    if place.line is not None:
        for index in range(start, min(stop + 2, len(tokens))):
            if tokens[index].place == place:
                return index
    return stop


_ENDS = re.compile(r"[\w$)\]\"']$")
_TYPE_WORDS = frozenset((
    "int", "char", "void", "unsigned", "signed", "long", "short", "const", "static", "struct", "union",
    "enum", "bit",
))  # fmt: skip
_STATEMENT_WORDS = _TYPE_WORDS | frozenset((
    "if", "while", "do", "for", "switch", "return", "break", "continue", "goto", "case", "default", "}",
))  # fmt: skip


def _wants_semicolon(tokens: list[PToken], start: int, index: int) -> bool:
    """Return whether a `;` is missing before a token: the text before it can end a statement or a part of a
    `for`, all its parentheses are closed, and the token begins another.
    """
    parenthesis = _unclosed_parenthesis(tokens, start, index)
    if parenthesis is not None and tokens[parenthesis - 1].text != "for":
        return False
    before, here = tokens[index - 1], tokens[index] if index < len(tokens) else None
    if here is None or not _ENDS.search(before.text) or before.text in _STATEMENT_WORDS:
        return False
    new_line = here.place.line != before.place.line
    return here.text in _STATEMENT_WORDS or (new_line and re.match(r"[A-Za-z_]", here.text) is not None)


def _unended(tokens: list[PToken], start: int, index: int) -> int | None:
    """Return the token that begins a declaration on a new line although the previous one is not
    terminated.
    """
    depth = 0
    for number in range(start + 1, index):
        before, here = tokens[number - 1], tokens[number]
        depth += {"{": 1, "(": 1, "[": 1, "}": -1, ")": -1, "]": -1}.get(before.text, 0)
        named = re.fullmatch(r"\w+|]", before.text) and before.text not in _TYPE_WORDS
        if depth == 0 and named and here.text in _TYPE_WORDS and here.place.line != before.place.line:
            return number
    return None


def _bracket_hint(tokens: list[PToken], start: int, index: int) -> str | None:
    """Return what is wrong with the brackets around token `index`, if that is clear."""
    opened, here = _open(tokens[start:index]), tokens[index].text
    if here == "}" and not opened:
        return "there is no '{' for it"
    parenthesis = _unclosed_parenthesis(tokens, start, index)
    if parenthesis is None:
        return None
    if here in _STATEMENT_WORDS or here in ("{", ";"):
        return f"the '(' at {tokens[parenthesis].place} is not closed"
    if here == ")" and tokens[parenthesis - 1].text == "for":
        return "'for' takes three parts with ';' between them"
    return None


def _unclosed_parenthesis(tokens: list[PToken], start: int, index: int) -> int | None:
    """Return the index of the `(` that is the last open bracket before token `index`."""
    opened = _open(tokens[start:index])
    return tokens.index(opened[-1], start) if opened and opened[-1].text == "(" else None


def _unclosed(tokens: list[PToken]) -> PToken | None:
    return next(iter(_open(tokens)), None)


def _open(tokens: list[PToken]) -> list[PToken]:
    """Return the brackets that are still open after `tokens`."""
    stack: list[PToken] = []
    for token in tokens:
        if token.text in ("{", "(", "["):
            stack.append(token)
        elif token.text in ("}", ")", "]") and stack:
            stack.pop()
    return stack


def resume(tokens: list[PToken], start: int, stop: int) -> int:
    """Return the token after the declaration that contains token `at`: after its closing brace or
    semicolon.
    """
    depth = 0
    for index in range(start, len(tokens)):
        text = tokens[index].text
        if text == "{":
            depth += 1
        elif text == "}":
            depth = max(0, depth - 1)
            ended = depth == 0
            if ended and index >= stop:
                return index + 1
        elif text == ";" and depth == 0 and index >= stop:
            return index + 1
        elif (
            depth
            and index > stop
            and tokens[index].place.column == 1
            and tokens[index - 1].text in ("}", ";")
            and text in ("void", "int", "char", "unsigned", "static", "main", "const")
        ):
            return index  # a brace was lost: a declaration in the first column starts anew
    return len(tokens)


def declared(tokens: list[PToken]) -> set[str]:
    """Return the names outside all brackets of a declaration that could not be parsed: it may declare
    them.
    """
    depth = 0
    names = set()
    for token in tokens:
        depth += {"(": 1, "{": 1, "[": 1, ")": -1, "}": -1, "]": -1}.get(token.text, 0)
        if depth == 0 and re.match(r"[A-Za-z_]", token.text):
            names.add(token.text)
    return names
