"""Errors with a place: where it is wrong, what is wrong, what is allowed or what to do.

The command line prints them as `place: message` and, below, the hint; its exit code is the error's.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches


@dataclass(frozen=True, slots=True)
class Place:
    """Where: a file (or port), a line and column counted from 1, or a key of a file."""

    file: str | None = None
    line: int | None = None
    column: int | None = None
    key: str | None = None

    def __str__(self) -> str:
        numbers = [number for number in (self.line, self.column) if number is not None]
        if self.file:
            where = ":".join([self.file, *map(str, numbers)])
        else:
            where = ", ".join(
                f"{word} {number}" for word, number in zip(("line", "column"), numbers, strict=False)
            )
        return ": ".join(part for part in (where, self.key) if part)


class ServogenError(Exception):
    """The root of every error that a user can be shown without a traceback."""

    exit_code = 2

    def __init__(self, message: str, place: Place | None = None, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.place = place
        self.hint = hint

    def __str__(self) -> str:
        where = str(self.place) if self.place else ""
        first = f"{where}: {self.message}" if where else self.message
        return f"{first}\n  {self.hint}" if self.hint else first

    def __reduce__(self) -> tuple[object, ...]:
        """Returns how to make it again in another process, whatever a derived class is constructed from."""
        return _made_again, (type(self), self.args), self.__dict__


def _made_again(kind: type[ServogenError], args: tuple[object, ...]) -> ServogenError:
    error = kind.__new__(kind)
    error.args = args
    return error


class InputError(ServogenError):
    """What the user gave is wrong: exit code 2."""


class ToolError(ServogenError):
    """A tool or the bench is missing or failed: exit code 3."""

    exit_code = 3


@dataclass(frozen=True, slots=True)
class Caution:
    """A warning: nothing is refused, but the user should know. `code` names its kind, as "period-range"."""

    code: str
    text: str
    place: Place | None = None

    def __str__(self) -> str:
        return f"{self.place}: {self.text}" if self.place else self.text


MAX_LISTED, MAX_COMPARED = 100, 1000
"""Known words that are listed, and that are compared with a misspelt one."""

MAX_WORD = 100
"""Letters of a word for which a near one is looked for."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Returns a sentence that names the known word nearest to `word`, or all of them when none is near."""
    names = sorted(known)
    lower = {name.lower(): name for name in reversed(names[:MAX_COMPARED])}
    close = get_close_matches(word[:MAX_WORD].lower(), lower, n=1, cutoff=0.6)
    if close:
        return f"did you mean '{lower[close[0]]}'?"
    more = ", …" if len(names) > MAX_LISTED else ""
    return f"known: {', '.join(names[:MAX_LISTED])}{more}"
