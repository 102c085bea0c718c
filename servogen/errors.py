"""Diagnostics: what is wrong, how badly, where, and what to do about it; and the errors that carry them.

Diagnostics are formatted as gcc's are, so that editors find the place: `file:line:column: error: key: message
[code]`, with the hint below. docs/diagnostics.md explains every code.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, Literal, Self

if TYPE_CHECKING:
    from servogen.answers import DiagnosticAnswer

Severity = Literal["error", "warning", "note"]

PROGRAM = "servogen"
"""The name shown in place of a file if a diagnostic has none."""


@dataclass(frozen=True, slots=True)
class Location:
    """A place: a file (or port), a line and column counted from 1, a key of the file; in a running program
    the instruction cycle since reset and the address of the instruction.
    """

    file: str | None = None
    line: int | None = None
    column: int | None = None
    key: str | None = None
    cycle: int | None = None
    address: int | None = None

    @property
    def in_file(self) -> str:
        """Return `file:line:column` as far as it is known; empty without a file."""
        numbers = (str(number) for number in (self.line, self.column) if number is not None)
        return ":".join([self.file, *numbers]) if self.file else ""

    @property
    def beside(self) -> str:
        """Return what `in_file` omits: the key, or the cycle and the address."""
        parts = [self.key] if self.key else []
        if not self.file:
            named = (("line", self.line), ("column", self.column))
            parts[:0] = [f"{word} {number}" for word, number in named if number is not None]
        parts += [] if self.cycle is None else [f"cycle {self.cycle}"]
        parts += [] if self.address is None else [f"address 0x{self.address:03X}"]
        return ", ".join(parts)

    def __str__(self) -> str:
        return ": ".join(part for part in (self.in_file, self.beside) if part)


SourceLines = Mapping[tuple[str, int], str]
"""Source lines by file and line number, for the line and the caret below a diagnostic."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One error, warning or note; `code` is its stable name in kebab case, such as "unknown-pin"."""

    severity: Severity
    code: str
    message: str
    location: Location | None = None
    hint: str | None = None

    def __str__(self) -> str:
        return self.render()

    def render(self, lines: SourceLines | None = None) -> str:
        """Return the diagnostic as text, with its source line and a caret if `lines` has the line."""
        location = self.location or Location()
        about = f"{location.beside}: " if location.beside else ""
        shown = [f"{location.in_file or PROGRAM}: {self.severity}: {about}{self.message} [{self.code}]"]
        line = (lines or {}).get((location.file or "", location.line or 0))
        if line is not None:
            shown.append(f"    {line}")
            if location.column is not None:
                before = line[: location.column - 1]
                shown.append("    " + "".join("\t" if sign == "\t" else " " for sign in before) + "^")
        if self.hint:
            shown.append(f"  {self.hint}")
        return "\n".join(shown)

    @property
    def sentence(self) -> str:
        """Return the location and the message only, for a report."""
        return ": ".join(part for part in (str(self.location or ""), self.message) if part)

    def to_json(self) -> DiagnosticAnswer:
        """Return the diagnostic as a value that JSON can hold."""
        place = self.location or Location()
        return {
            "severity": self.severity,
            "code": self.code,
            "message": self.message,
            "file": place.file,
            "line": place.line,
            "column": place.column,
            "key": place.key,
            "cycle": place.cycle,
            "address": place.address,
            "hint": self.hint,
        }


def rendered(diagnostics: Iterable[Diagnostic], lines: SourceLines | None = None) -> str:
    """Return diagnostics as text. A warning that is said several times is shown once, with the places of the
    others.
    """
    groups: dict[object, list[Diagnostic]] = {}
    for each in diagnostics:
        same = (each.code, each.message, each.hint) if each.severity == "warning" else id(each)
        groups.setdefault(same, []).append(each)
    shown = []
    for first, *others in groups.values():
        shown.append(first.render(lines))
        places = [str(each.location) for each in others if each.location]
        if others:
            more = ", …" if len(places) > MAX_PLACES else ""
            where = f": {', '.join(places[:MAX_PLACES])}{more}" if places else ""
            shown.append(f"  and {len(others)} more like it{where}")
    return "\n".join(shown)


MAX_PLACES = 5
"""How many places of equal warnings are listed."""


class ServogenError(Exception):
    """The base class of all errors that are shown to users without a traceback.

    It carries one diagnostic, or all diagnostics collected before giving up, including warnings. `details`
    are what its JSON document states beside them.
    """

    exit_code = 2

    def __init__(
        self, code: str, message: str, location: Location | None = None, hint: str | None = None
    ) -> None:
        super().__init__(message)
        self.diagnostics: tuple[Diagnostic, ...] = (Diagnostic("error", code, message, location, hint),)
        self.source_lines: SourceLines = {}
        self.details: Mapping[str, object] = {}

    @classmethod
    def of(cls, diagnostics: Iterable[Diagnostic], source_lines: SourceLines | None = None) -> Self:
        """Return an error that carries all of `diagnostics`, at least one of them an error."""
        collected = tuple(diagnostics)
        first = next(diagnostic for diagnostic in collected if diagnostic.severity == "error")
        error = cls.__new__(cls)
        error.args = (first.message,)
        error.diagnostics = collected
        error.source_lines = source_lines or {}
        error.details = {}
        return error

    @property
    def first(self) -> Diagnostic:
        """Return the first error among the diagnostics."""
        return next(diagnostic for diagnostic in self.diagnostics if diagnostic.severity == "error")

    @property
    def code(self) -> str:
        return self.first.code

    @property
    def message(self) -> str:
        return self.first.message

    @property
    def location(self) -> Location | None:
        return self.first.location

    @property
    def hint(self) -> str | None:
        return self.first.hint

    def at(self, location: Location | None) -> Self:
        """Return the same error at another location, for callers that know where a value came from."""
        moved = copy(self)
        moved.diagnostics = (replace(self.first, location=location),)
        return moved

    def __str__(self) -> str:
        return rendered(self.diagnostics, self.source_lines)

    def __reduce__(self) -> tuple[object, ...]:
        """Return how to rebuild the error in another process, whatever arguments a subclass takes."""
        return _rebuilt, (type(self), self.args), self.__dict__


def _rebuilt(kind: type[ServogenError], args: tuple[object, ...]) -> ServogenError:
    rebuilt = kind.__new__(kind)
    rebuilt.args = args
    return rebuilt


class InputError(ServogenError):
    """Wrong input from the user: exit code 2."""


class ToolError(ServogenError):
    """A tool or the bench is missing or failed: exit code 3."""

    exit_code = 3


MAX_LISTED, MAX_COMPARED = 100, 1000
"""The maximum number of known words that are listed, or compared with a misspelt one."""

SIMILAR = 0.65
"""The least similarity (`difflib`) of a word that is suggested: "tripd" is "tripod", "trot" is not."""

MAX_WORD = 100
"""The maximum number of letters of a misspelt word that are compared."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a hint with the known word most similar to `word`, or all known words if none is similar."""
    names = sorted(known)
    lower = {name.lower(): name for name in reversed(names[:MAX_COMPARED])}
    close = get_close_matches(word[:MAX_WORD].lower(), lower, n=1, cutoff=SIMILAR)
    if close:
        return f"did you mean '{lower[close[0]]}'?"
    more = ", …" if len(names) > MAX_LISTED else ""
    return f"known: {', '.join(names[:MAX_LISTED])}{more}"


def check_known(
    code: str, word: str, known: Collection[str], message: str, place: Location | None = None
) -> None:
    """Raise InputError, with the known word most similar to it as a hint, for a word that is not known."""
    if word not in known:
        raise InputError(code, message, place, did_you_mean(word, known))
