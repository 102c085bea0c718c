"""From tokens to a syntax tree: pycparser's recursive descent, fed with tokens that carry their own
locations.

In: preprocessing tokens after the dialect's rewriting. Out: a pycparser tree. After a syntax error the parser
resumes at the next function, so that one run reports the errors of each.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NoReturn

from pycparser import c_ast, c_lexer
from pycparser.c_parser import CParser, ParseError

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.extensions import EEPROM
from servogen.compiler.frontend.preprocessor import PToken
from servogen.compiler.frontend.syntax_errors import SyntaxFault, declared, report_syntax, resume

_NAME = re.compile(r"[A-Za-z_$][\w$]*")
_FLOAT = re.compile(r"(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][+-]?\d+)?[fFlL]?")
_HEX_FLOAT = re.compile(r"0[xX](?=\.?[\da-fA-F])[\da-fA-F]*\.?[\da-fA-F]*[pP][+-]?\d+[fFlL]?")
_INTEGER = re.compile(r"(?:0[xX][0-9a-fA-F]+|[0-9]+)([uUlL]*)")


@cache
def _punctuators() -> dict[str, str]:
    """Return pycparser's token type for each punctuator."""
    lexer = c_lexer.CLexer(_no_error)
    kinds = {}
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
        kinds[text] = token.type if token else ""
    return kinds


def _no_error(message: str, line: int, column: int) -> None:
    raise ValueError(f"{line}:{column}: {message}")


@cache
def _keywords() -> dict[str, str]:
    """Return pycparser's token types of the keywords that this compiler knows, XC8's qualifier among them."""
    unwanted = {"offsetof", "_Complex", "_Atomic", "_Thread_local", "__int128", "__builtin_va_arg"}
    words = c_lexer.CLexer(_no_error)._keyword_map
    return {word: kind for word, kind in words.items() if word not in unwanted} | {EEPROM: words["restrict"]}


class _NoLexer:
    """Stands where pycparser expects its lexer: the tokens are ready-made."""

    filename = ""

    def __init__(self, error_func: Callable[[str, int, int], None], *, dialect: str = "legacy") -> None:
        pass

    def token(self) -> None:
        """Return no token: `_Tokens` has them."""


class _Tokens:
    """Replaces pycparser's token stream, which asks a lexer for each token; None behind the last token."""

    def __init__(self, tokens: list[c_lexer.Token]) -> None:
        self.tokens = tokens
        self.index = 0

    def peek(self, ahead: int = 1) -> c_lexer.Token | None:
        index = self.index + ahead - 1
        return self.tokens[index] if index < len(self.tokens) else None

    def next(self) -> c_lexer.Token | None:
        token = self.peek()
        self.index += 1
        return token

    def mark(self) -> int:
        return self.index

    def reset(self, mark: int) -> None:
        self.index = mark


class _Parser(CParser):  # type: ignore[misc]
    """pycparser's parser, resuming after a syntax error and noting expressions in parentheses."""

    parenthesised: set[int]

    def _parse_error(self, msg: str, coord: Any) -> NoReturn:
        raise SyntaxFault(msg, coord)

    def _parse_primary_expression(self) -> Any:
        opening = self._peek_type() == "LPAREN"
        node = super()._parse_primary_expression()
        if opening:
            self.parenthesised.add(id(node))
        return node

    def _parse_unified_string_literal(self) -> Any:
        """Parse adjacent strings. Each keeps its quotes, because an escape ends with its string (ISO C
        5.1.1.2): `"\\x1" "2"` has two characters.
        """
        first = self._expect("STRING_LITERAL")
        spelled = [first.value]
        while self._peek_type() == "STRING_LITERAL":
            spelled.append(self._advance().value)
        return c_ast.Constant("string", " ".join(spelled), self._tok_coord(first))

    def _fix_decl_name_type(self, decl: Any, typename: Any) -> Any:
        """Complete a declaration; its location is that of its name, also behind a `*` or `(`."""
        declaration = super()._fix_decl_name_type(decl, typename)
        if declaration.name is not None:
            declaration.coord = _name(declaration).coord
        return declaration

    def index(self) -> int:
        return int(self._tokens.mark())

    def units(
        self, tokens: list[c_lexer.Token], typedefs: Iterable[str], fault: Callable[..., int]
    ) -> list[Any]:
        """Parse the whole file; `fault` reports an error and returns the token at which to resume."""
        # a scope for the predefined types, which a declaration of the file may hide
        self._scope_stack = [dict.fromkeys(typedefs, True), {}]
        self._typedef_checked_token = None
        self._tokens = _Tokens(tokens)
        declarations: list[Any] = []
        while self._peek() is not None:
            start = self.index()
            try:
                declarations.extend(self._parse_external_declaration())
            except (
                ParseError,
                AssertionError,
                AttributeError,
                IndexError,
                TypeError,
                RecursionError,
            ) as error:
                # pycparser raises those after the first on input that its grammar did not foresee
                del self._scope_stack[2:]
                self._typedef_checked_token = None
                self._tokens.reset(fault(error, start, self.index()))
        return declarations


def _name(declaration: Any) -> Any:
    """Return the innermost declarator, which stands for the name."""
    while not isinstance(declaration, c_ast.TypeDecl):
        declaration = declaration.type
    return declaration


def parse(
    tokens: list[PToken], typedefs: Iterable[str], reporter: Reporter, parenthesised: set[int]
) -> list[Any]:
    """Return the external declarations of a file. Syntax errors are reported to the reporter; the identities
    of the expressions that stand in parentheses are added to `parenthesised`.
    """
    kinds = _punctuators() | _keywords()
    stream = [_token(token, kinds, reporter) for token in tokens]
    parser = _Parser(lexer=_NoLexer)
    parser.parenthesised = parenthesised

    def fault(error: Exception, start: int, stop: int) -> int:
        if isinstance(error, RecursionError):
            raise reporter.too_deep(tokens[min(stop, len(tokens) - 1)].place) from None
        report_syntax(error, tokens, start, stop, reporter)
        after = resume(tokens, start, max(stop, start + 1))
        reporter.lost |= declared(tokens[start:after])
        return after

    return parser.units(stream, typedefs, fault)


def _token(token: PToken, kinds: dict[str, str], reporter: Reporter) -> c_lexer.Token:
    """Return a token as pycparser reads it; `kinds` holds the kinds of words and signs, and learns names."""
    text, place = token
    kind = kinds.get(text)
    if kind is None:
        if text[0] == '"':
            kind = "STRING_LITERAL"
        elif text[0] == "'":
            kind = "CHAR_CONST"
        elif _NAME.fullmatch(text):
            kind = kinds[text] = "ID"
        elif _FLOAT.fullmatch(text):
            kind = "FLOAT_CONST"
        elif _HEX_FLOAT.fullmatch(text):
            kind = "HEX_FLOAT_CONST"
        elif match := _INTEGER.fullmatch(text):
            kind = "INT_CONST_DEC"
            if match[1].lower() not in ("", "u", "l", "ul", "lu", "ll", "ull", "llu"):
                reporter.error("c-number", f"'{text}' is not a number: unknown suffix '{match[1]}'", place)
                text = "0"
            elif text[0] == "0" and text[1:2] not in ("x", "X") and re.search("[89]", text):
                reporter.error("c-number", f"'{text}' is not a number: octal digits are 0 to 7", place)
                text = "0"
        elif text[0].isdigit():
            reporter.error("c-number", f"'{text}' is not a number", place)
            kind, text = "INT_CONST_DEC", "0"
        else:
            reporter.error("c-syntax", f"the character {text!r} has no meaning in C", place)
            kind, text = "SEMI", ";"
    return c_lexer.Token(kind, text, place.line or 0, place.column or 0, place.file or "")
