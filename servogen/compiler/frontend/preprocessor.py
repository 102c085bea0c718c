"""The C preprocessor: from source text to tokens that know their file, line and column.

In: a source file and the dialect's predefined macros. Out: tokens for the parser, the `#pragma` lines, and
the values of macros that the compiler itself reads (`_CLOCK_FREQ`, `_XTAL_FREQ`). pcpp does the work.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from types import SimpleNamespace
from typing import Any, NamedTuple

from pcpp import parser
from pcpp.parser import lex
from pcpp.preprocessor import Action, OutputDirective, Preprocessor

import servogen.compiler.library as library
import servogen.compiler.limits as limits
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.assembly import (
    AsmBlock,
    assembly_macros,
    decimal,
    hexadecimal,
    plain_numbers,
    rewrite,
)
from servogen.compiler.frontend.conditions import DirectiveCondition
from servogen.compiler.frontend.macros import SPACE, Replacer, copied
from servogen.errors import InputError, Location

Resolver = Callable[[str, str], tuple[str, str] | None]
"""(name, including file) -> (file name to show, text), or None when there is no such file."""


_MAX_MESSAGE_CHARACTERS = 200
"""Characters of the preprocessor's own messages, which quote the source."""


class PToken(NamedTuple):
    """A preprocessing token: its text and its location in the user's source."""

    text: str
    place: Location


@dataclass(frozen=True, slots=True)
class Pragma:
    """A `#pragma` line, with its macros expanded."""

    words: str
    place: Location


@dataclass(slots=True)
class Preprocessed:
    """One source file after preprocessing."""

    tokens: list[PToken]
    pragmas: list[Pragma]
    macros: dict[str, tuple[str, Location]]
    """Object-like macros at the end of the file."""


def _number(token: Any) -> Any:
    r"""0[xX](?:[pP][+-]|[\w.])*|\d(?:[eE][+-]|[\w.])*"""
    return token


@cache
def _lexer() -> Any:
    """Return pcpp's lexer, for which a preprocessing number is one token (ISO C 6.4.8): the F of 2.5F and the
    x of 0x are no names that a macro could replace. PLY takes the pattern of a token from the docstring of
    its rule.
    """
    rules = {
        name: rule for name, rule in vars(parser).items() if name.startswith(("t_", "tokens", "literals"))
    }
    rules |= {"t_CPP_INTEGER": _number, "t_CPP_XOREQUAL": r"\^="}
    return lex.lex(SimpleNamespace(**rules, __file__=__file__), lextab="")


class _Pcpp(Preprocessor):  # type: ignore[misc]
    """pcpp with its files, errors and pragmas routed to this compiler."""

    def __init__(
        self,
        reporter: Reporter,
        headers: Mapping[str, str],
        resolver: Resolver | None,
        blocks: list[AsmBlock],
    ) -> None:
        super().__init__(_lexer().clone())
        self.rewrite_paths: list[tuple[str, str]] = []  # a file keeps the name by which its text is found
        self.reporter = reporter
        self.headers = headers
        self.resolver = resolver
        self.blocks = blocks
        self.pragmas: list[Pragma] = []
        self.line_directive = None
        self.evaluator = self.condition
        counter = count()
        self.replacer = Replacer(
            self.macros,
            {"__LINE__": lambda tok: tok.lineno, "__COUNTER__": lambda _: next(counter)},
            self.spelled,
            self.joined,
            self.limit,
            self.misused,
        )
        self.depth = 0
        self.starts: dict[str, list[int]] = {}
        """Where each line starts in the text that the lexer sees."""
        self.included = 0
        self.read = 0
        self.expanded = 0

    def condition(self, tokens: list[Any], **_names: Any) -> Any:
        """Return the value of the expression of an #if, as pcpp asks for it."""
        words = [tok.value for tok in tokens if tok.type not in SPACE]
        value = 0
        try:
            value = DirectiveCondition(words).value()
        except ValueError as fault:
            self.on_error(tokens[0].source, tokens[0].lineno, f"the expression of #if: {fault}")
        return SimpleNamespace(value=lambda: value)

    def on_error(self, file: str, line: int, msg: str) -> None:
        if len(msg) > _MAX_MESSAGE_CHARACTERS:
            msg = msg[:_MAX_MESSAGE_CHARACTERS] + "…"
        place = Location(file or None, line or None)
        if not line and self.lastdirective is not None:  # pcpp gives an #if without an expression no place
            place = Location(self.lastdirective.source, self.lastdirective.lineno)
        self.reporter.error("c-preprocessor", f"preprocessor: {msg}", place)

    def on_directive_unknown(self, directive: Any, toks: Any, ifpassthru: bool, precedingtoks: Any) -> bool:
        """Handle the directives that pcpp leaves to its user: #pragma, #error, #warning, #line."""
        words = "".join(tok.value for tok in toks)
        place = Location(directive.source, directive.lineno)
        if directive.value == "pragma":
            expanded = self.expand_macros([copied(tok) for tok in toks[1:]])
            rest = decimal("".join(tok.value for tok in expanded))
            self.pragmas.append(Pragma((toks[0].value + rest) if toks else "", place))
        elif directive.value == "error":
            self.reporter.error("c-user-message", f"#error {words}", place)
        elif directive.value == "warning":
            self.reporter.warn("c-user-message", f"#warning {words}", place)
        elif directive.value == "line":
            self.reporter.error(
                "c-preprocessor", "#line is not supported: messages name the lines of the file itself", place
            )
        else:
            self.reporter.error("c-preprocessor", f"unknown preprocessor directive #{directive.value}", place)
        raise OutputDirective(Action.IgnoreAndRemove)

    def on_comment(self, tok: Any) -> bool:
        return False

    def include(self, tokens: list[Any], original_line: list[Any]) -> Iterator[Any]:
        """Yield the tokens of an included file: the compiler's own header, or what the resolver gives (ISO C
        6.10.2).
        """
        tokens = self.tokenstrip(tokens)
        written = "".join(tok.value for tok in tokens)
        place = Location(original_line[0].source, original_line[0].lineno)
        match = re.fullmatch(r'(?:<([^>]+)>|"([^"]+)")(\s*;)?', written.strip())
        if not match:
            self.reporter.error("c-preprocessor", "#include needs a file name in <…> or quotes", place)
            return
        if match[3]:
            self.reporter.warn("c-preprocessor", "the ';' behind #include is ignored", place)
        name = match[1] or match[2]
        if name in self.headers:
            named_text: tuple[str, str] | None = (f"<{name}>", self.headers[name])
        elif name in library.HEADERS:
            named_text = (f"<{name}>", library.header(name))
        else:
            try:
                named_text = self.resolver(name, place.file or "") if self.resolver else None
            except InputError as refusal:
                self.reporter.error(
                    "c-include", f"include file '{name}' {refusal.message}", place, hint=refusal.hint
                )
                return
        if named_text is None:
            known = ", ".join(sorted((*self.headers, *library.HEADERS)))
            self.reporter.error(
                "c-include",
                f"include file '{name}' was not found",
                place,
                hint=f"the compiler's own headers: {known}",
            )
            return
        if named_text[0] in self.include_once:
            return
        self.included += 1
        if self.included > limits.INCLUDES:
            raise self.reporter.fatal("c-include", f"more than {limits.INCLUDES} files are included", place)
        if self.depth >= 20:
            self.reporter.error("c-include", "#include is nested more than 20 levels deep", place)
            return
        self.depth += 1
        yield from self.parsegen(
            self.prepare(named_text[1], named_text[0], place), named_text[0], named_text[0]
        )
        self.depth -= 1

    def value(self, name: str) -> str | None:
        """Return the expansion of an object-like macro at this point, as assembly writes it."""
        macro = self.macros.get(name)
        if macro is None or macro.arglist is not None:
            return None
        expanded = self.expand_macros([copied(tok) for tok in macro.value])
        return plain_numbers("".join(tok.value for tok in expanded).strip())

    def spelled(self, tokens: list[Any]) -> str:
        """Return the string of the spelling of an argument."""
        text = ""
        for tok in tokens:
            if tok.type in self.t_WS:
                text = text.rstrip(" ") + " "
            elif tok.type in (self.t_STRING, self.t_CHAR):
                text += re.sub(r'["\\]', r"\\\g<0>", tok.value)
            else:
                text += tok.value
        text = text.strip(" ")
        if not re.fullmatch(r'(?:[^"\\]|\\.)*', text, re.DOTALL):
            place = Location(tokens[0].source, tokens[0].lineno)
            self.reporter.error("c-preprocessor", f"the '#' of a macro makes no string of '{text}'", place)
            text = ""
        return f'"{text}"'

    def joined(self, left: Any, right: Any) -> list[Any]:
        """Return the token that two make, or both if they make none."""
        lexer = self.lexer.clone()
        lexer.input(left.value + right.value)
        tokens = list(iter(lexer.token, None))
        if len(tokens) != 1:
            return [left, right]
        token = copied(left)
        token.type, token.value = tokens[0].type, tokens[0].value
        return [token]

    def limit(self, name: Any, body: list[Any]) -> None:
        """Keep what macros expand to within a limit."""
        self.expanded += sum(len(tok.value) for tok in body)
        if self.expanded > limits.EXPANDED_CHARACTERS:
            raise self.reporter.fatal(
                "program-too-large",
                f"the macros expand to more than {limits.EXPANDED_CHARACTERS} characters",
                Location(name.source, name.lineno),
            )

    def misused(self, name: Any, message: str) -> None:
        self.on_error(name.source, name.lineno, message)

    def macro_prescan(self, macro: Any) -> None:
        """Leave the tokens of a macro as they are, for the replacer."""

    def expand_macros(self, tokens: list[Any], expanding_from: Sequence[str] = ()) -> list[Any]:
        """Expand the macros in a list of tokens."""
        return self.replacer.replace(tokens)

    def prepare(self, text: str, file: str, place: Location) -> str:
        """Register a source text that is included at a location, and return it as the lexer must see it."""
        self.read += len(text)
        if len(text) > limits.SOURCE_CHARACTERS:
            raise self.reporter.fatal(
                "program-too-large",
                f"'{file}' has {len(text)} characters, a source file has at most {limits.SOURCE_CHARACTERS}",
                place,
            )
        if self.read > limits.ALL_CHARACTERS:
            raise self.reporter.fatal(
                "program-too-large",
                f"the source files have more than {limits.ALL_CHARACTERS} characters together",
                place,
            )
        text = text.replace("\r\n", "\n").replace("\r", "\n")
        self.reporter.add_source(file, text)
        clean = "\n".join(line.rstrip() for line in text.splitlines())
        lines = [line.rstrip() for line in rewrite(clean, file, self.blocks, self.reporter).splitlines()]
        if sum(len(block.lines) for block in self.blocks) > limits.ASSEMBLY_LINES:
            last = self.blocks[-1].lines
            raise self.reporter.fatal(
                "program-too-large",
                f"the program has more than {limits.ASSEMBLY_LINES} lines of assembly",
                Location(file, last[-1][0] if last else None),
            )
        offsets = [0]
        for line in lines:
            offsets.append(offsets[-1] + len(line) + 1)
        self.starts[file] = offsets
        return "\n".join(lines)


def preprocess(
    text: str,
    file: str,
    *,
    defines: Mapping[str, str],
    headers: Mapping[str, str],
    resolver: Resolver | None,
    reporter: Reporter,
    blocks: list[AsmBlock],
) -> Preprocessed:
    """Preprocess one source file. Errors are reported to the reporter."""
    pcpp = _Pcpp(reporter, headers, resolver, blocks)
    for name, value in defines.items():
        pcpp.define(f"{name} {value}")
    predefined = set(pcpp.macros)
    tokens: list[PToken] = []
    try:
        stream = pcpp.parsegen(pcpp.prepare(text, file, Location(file)), file, file)
        stream = assembly_macros(stream, blocks, pcpp.value)
        for token in _placed(stream, reporter, pcpp.starts):
            tokens.append(token)
            if len(tokens) > limits.TOKENS:
                raise reporter.fatal(
                    "program-too-large",
                    f"the program has more than {limits.TOKENS} tokens",
                    token.place,
                )
    except RecursionError:
        reporter.error("nested-too-deeply", "macros are nested too deeply", Location(file))
    except (IndexError, AttributeError, ValueError, TypeError, StopIteration, RuntimeError):
        # pcpp trips over malformed directives (an #if or #define without operands) in these ways.
        where = pcpp.lastdirective
        place = Location(where.source, where.lineno) if where is not None else Location(file)
        reporter.error("c-preprocessor", "malformed preprocessor directive", place)
    macros = {
        name: ("".join(tok.value for tok in macro.value).strip(), Location(macro.source, macro.lineno))
        for name, macro in pcpp.macros.items()
        if name not in predefined and macro.arglist is None
    }
    return Preprocessed(tokens, pcpp.pragmas, macros)


def _begins_number(name: str, before: str, text: str) -> bool:
    """Return whether a point and digits are a number, as in `= .5`, and not a bit, as in `name.7`."""
    if before != "." or not text[0].isdigit():
        return False
    names_object = re.fullmatch(r"\w+|[)\]]", name) is not None and name not in ("return", "else", "case")
    return not names_object


def _placed(stream: Iterator[Any], reporter: Reporter, starts: dict[str, list[int]]) -> Iterator[PToken]:
    """Return tokens without white space; a point and the digits that touch it are joined where they are one
    number.
    """
    pending: PToken | None = None
    name = ""
    last = Location()
    touching = False
    for tok in stream:
        if tok.type in ("CPP_WS", "CPP_LINECONT") or not tok.value.strip():
            touching = False
            continue
        text = hexadecimal(tok.value) if tok.type == "CPP_INTEGER" else tok.value
        last = _place(tok, starts, reporter, last)
        if pending is None:
            pending = PToken(text, last)
        elif touching and _begins_number(name, pending.text, text):
            pending = PToken(pending.text + text, pending.place)
        else:
            yield pending
            name = pending.text
            pending = PToken(text, last)
        touching = True
    if pending is not None:
        yield pending


def _place(tok: Any, starts: dict[str, list[int]], reporter: Reporter, last: Location) -> Location:
    """Return the location of a token; of one from a macro, that of the macro's name in the line."""
    file, line = tok.source, tok.lineno
    lines = reporter.lines(file)
    macro = getattr(tok, "outermost", "")
    if not 0 < line <= len(lines):
        return Location(file, line)
    if macro:
        # a macro may be used twice in a line: the search continues behind the token before
        after = last.column - 1 if last.line == line and last.file == file and last.column else 0
        match = re.compile(rf"\b{re.escape(macro)}\b").search(lines[line - 1], after)
        return Location(file, line, match.start() + 1 if match else None)
    column = tok.lexpos - starts[file][line - 1] + 1
    return Location(file, line, column if 0 < column <= len(lines[line - 1]) + 1 else None)
