"""Textual substitution of names: `#define`, the parameters of a macro, and `#v(expression)`.

In: a line's `Text`. Out: the line with every name outside strings and comments replaced.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.text import IDENTIFIER, Text


@dataclass(frozen=True, slots=True)
class Definition:
    """The contents of `#define name(parameters) body`."""

    body: str
    parameters: tuple[str, ...] = ()


DEEPEST_DEFINITIONS = 100
"""`#define`d names within the replacement of each other."""

_KEPT = re.compile(r"\s*#?(?:define|undefine|ifdef|ifndef)\b", re.IGNORECASE)
"""These directives take a name as it stands."""

_WORD = re.compile(r"[bodhqaBODHQA]'[^']*'|" + IDENTIFIER.pattern + r"|[0-9][\w]*")


def substitute(
    text: Text,
    definitions: Mapping[str, Definition],
    spend: Callable[[], None],
    within: frozenset[str] = frozenset(),
) -> Text:
    """Return the line with its `#define`d names replaced, and those in their replacements.

    A name is not replaced within its own replacement, so that circular definitions end; `within` holds the
    names being replaced. Calls `spend` for each replacement, because replacements can double at each step.
    """
    if not definitions or _KEPT.match(text.chars):
        return text
    if len(within) > DEEPEST_DEFINITIONS:
        raise SourceError("asm-too-complex", "definitions are nested too deeply", text.column(0))
    index = 0
    while span := _next_name(text, index, definitions, within):
        spend()
        start, end = span
        name = text.chars[start:end]
        definition = definitions[name]
        body = Text(definition.body, (text.column(start),) * len(definition.body))
        if definition.parameters:
            arguments, end = _arguments(text, end, len(definition.parameters))
            if arguments is None:
                index = end
                continue
            values = [
                substitute(Text.of(argument), definitions, spend, within).chars for argument in arguments
            ]
            body = parameters(body, dict(zip(definition.parameters, values, strict=True)))
        body = substitute(body, definitions, spend, within | {name})
        text = text.replace(start, end, body.chars)
        index = start + len(body.chars)
    return text


def _next_name(
    text: Text, index: int, names: Mapping[str, object], but: frozenset[str] = frozenset()
) -> tuple[int, int] | None:
    """Return the start and end of the next known name outside strings and comments, except `but`."""
    limit = len(text.without_comment().chars)
    spans = text.quoted()
    for match in _WORD.finditer(text.chars, index, limit):
        start, end = match.span()
        if match[0] in names and match[0] not in but and not any(a <= start < b for a, b in spans):
            return start, end
    return None


def parameters(text: Text, values: Mapping[str, str], *, joined: bool = False) -> Text:
    """Return the text with the names of parameters replaced by their arguments; if `joined`, as pic-as does:
    a `&` between one and what it touches joins them, and 'name' is its character.
    """
    index = 0
    for quoted in reversed(list(_QUOTED_NAME.finditer(text.chars)) if joined else []):
        if quoted[1] in values:
            text = text.replace(*quoted.span(), f"'{values[quoted[1]]}'")
    while span := _next_name(text, index, values):
        start, end = span
        value = values[text.chars[start:end]]
        if joined:
            start -= text.chars[:start].endswith("&") and not text.chars[: start - 1].endswith((" ", "\t"))
            end += bool(re.match(r"&\S", text.chars[end:]))
        text = text.replace(start, end, value)
        index = start + len(value)
    return text


def _arguments(text: Text, index: int, count: int) -> tuple[list[str] | None, int]:
    """Return the arguments after a name, in parentheses or up to the end of the line; None if their number is
    wrong.
    """
    opened = _OPENED.match(text.chars, index)
    if opened is None:
        end = len(text.without_comment().chars)
        plain = [part.chars for part in text[index:end].split(",")]
        return (plain, end) if len(plain) == count and all(plain) else (None, index)
    depth, end = 1, opened.end()
    spans = text.quoted()
    parts = [end]
    while end < len(text.chars) and depth:
        char = text.chars[end]
        # Parentheses and commas in strings and characters separate nothing.
        if not any(a <= end < b for a, b in spans):
            depth += (char == "(") - (char == ")")
            if char == "," and depth == 1:
                parts.append(end + 1)
        end += 1
    if depth or len(parts) != count:
        return None, index
    bounds = [*parts, end]
    pieces = [text.chars[a : b - 1].strip() for a, b in pairwise(bounds)]
    return pieces, end


_QUOTED_NAME = re.compile(r"'&?(\w{2,})'")
_OPENED = re.compile(r"\s*\(")
_DEFINES = re.compile(r"\s*#define\b", re.IGNORECASE)
_PASTE = re.compile(r"#[vV]\(")


def paste(text: Text, evaluate: Callable[[Text], int]) -> Text:
    """Return the line with each `#v(expression)` replaced by its value in decimal, which may end a name.

    In a `#define` it is kept for the lines that use the definition.
    """
    if _DEFINES.match(text.chars):
        return text
    while match := _PASTE.search(text.without_comment().chars):
        depth, end = 1, match.end()
        while end < len(text.chars) and depth:
            depth += (text.chars[end] == "(") - (text.chars[end] == ")")
            end += 1
        if depth:
            raise SourceError("asm-parenthesis", "unmatched (", text.column(match.end() - 1))
        value = evaluate(text[match.end() : end - 1])
        text = text.replace(match.start(), end, str(value))
    return text
