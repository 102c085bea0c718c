"""Programs with marks: ‸ stands where each diagnostic points to."""

from __future__ import annotations

from typing import Any

from servogen.compiler import Options, Source, compile_sources
from servogen.errors import Diagnostic, InputError

CARET = "‸"


def diagnostics(text: str, dialect: str = "xc8", **options: Any) -> tuple[Diagnostic, ...]:
    """Return what is reported about a program of one file."""
    try:
        return compile_sources([Source(text, "main.c")], Options(dialect, **options)).diagnostics
    except InputError as error:
        return error.diagnostics


def line_of(found: Diagnostic) -> str:
    """Return `code: message // hint`; an error begins with the word."""
    word = "" if found.severity == "warning" else f"{found.severity} "
    return f"{word}{found.code}: {found.message}{f' // {found.hint}' if found.hint else ''}"


def found_in(marked: str, dialect: str = "xc8", **options: Any) -> list[tuple[str, int, int]]:
    """Return (what is said, line, column) of all diagnostics of a marked program."""
    return [
        (line_of(each), each.location.line or 0, each.location.column or 0)
        for each in diagnostics(marked.replace(CARET, ""), dialect, **options)
        if each.location is not None
    ]


def stated(marked: str, said: list[str]) -> list[tuple[str, int, int]]:
    """Return the same as a marked program states it: the n-th mark belongs to the n-th text."""
    before, places = "", []
    for part in marked.split(CARET)[:-1]:
        before += part
        places.append((before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1))
    assert len(places) == len(said), "a mark for each text"
    return [(text, *place) for text, place in zip(said, places, strict=True)]
