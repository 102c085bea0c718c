"""The assembler's diagnostics: errors, warnings and messages, with MPASM's numbers.

Numbers: MPASM User's Guide DS33014, appendix "Errors, warnings, messages": errors are 1xx, warnings 2xx,
messages 3xx.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from servogen.errors import InputError, Location

Level = Literal["error", "warning", "message"]


class SourceError(Exception):
    """An error at a column of the current line; the assembler adds file and line."""

    def __init__(
        self, text: str, column: int | None = None, hint: str | None = None, number: int = 101
    ) -> None:
        super().__init__(text)
        self.text = text
        self.column = column
        self.hint = hint
        self.number = number


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One diagnostic for the source. `number` is MPASM's."""

    level: Level
    number: int
    text: str
    place: Location
    hint: str | None = None

    def __str__(self) -> str:
        first = f"{self.place}: {self.level}[{self.number}] {self.text}"
        return f"{first}\n  {self.hint}" if self.hint else first


class AssemblyError(InputError):
    """Raised when the source cannot be assembled: carries every error found, with the first as its own."""

    def __init__(self, diagnostics: tuple[Diagnostic, ...]) -> None:
        first = diagnostics[0]
        super().__init__(first.text, first.place, first.hint)
        self.diagnostics = diagnostics  # type: ignore[assignment]

    def __str__(self) -> str:
        return "\n".join(str(each) for each in self.diagnostics)


MOST_ERRORS = 100
"""Errors shown of one source; after as many, the rest says nothing new."""


@dataclass(slots=True)
class Log:
    """The diagnostics of one pass; `errorlevel` selects which warnings and messages are kept."""

    entries: dict[Diagnostic, None] = field(default_factory=dict)
    """Each once, in order."""
    least: int = 0
    """0 keeps all, 1 drops messages, 2 drops warnings too."""
    muted: set[int] = field(default_factory=set)

    def add(self, entry: Diagnostic) -> None:
        if entry.level != "error" and (entry.number in self.muted or self.least > _SEVERITY[entry.level]):
            return
        self.entries[entry] = None

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        return tuple(each for each in self.entries if each.level == "error")[:MOST_ERRORS]

    @property
    def remarks(self) -> tuple[Diagnostic, ...]:
        return tuple(each for each in self.entries if each.level != "error")


_SEVERITY = {"message": 0, "warning": 1}
