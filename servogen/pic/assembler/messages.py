"""The assembler's diagnostics: errors, warnings, and MPASM's messages as notes.

`NUMBERS` has MPASM's number of each warning and message, by which a source mutes it (MPASM User's Guide
DS33014, appendix "Errors, warnings, messages": warnings are 2xx, messages 3xx).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from servogen.errors import Diagnostic

NUMBERS: Mapping[str, int] = {
    "asm-else-if": 122,
    "asm-unknown-symbol": 201,
    "asm-argument-truncated": 202,
    "asm-opcode-column": 203,
    "asm-no-end": 205,
    "asm-label-column": 207,
    "asm-unclosed-quote": 209,
    "asm-unclosed-if": 212,
    "asm-processor": 215,
    "asm-no-register": 219,
    "asm-address-truncated": 220,
    "asm-deprecated": 224,
    "asm-defined-later": 230,
    "asm-user-message": 301,
    "asm-bank": 302,
    "asm-word-truncated": 303,
    "asm-id-truncated": 304,
    "asm-no-destination": 305,
    "asm-page": 312,
}


def muted_by(number: int) -> frozenset[str]:
    """Return the codes that `errorlevel -number` mutes: one, or none for a number that is not known."""
    return frozenset(code for code, known in NUMBERS.items() if known == number)


class SourceError(Exception):
    """An error at a column of the current line; the assembler adds file and line."""

    def __init__(self, code: str, text: str, column: int | None = None, hint: str | None = None) -> None:
        super().__init__(text)
        self.code = code
        self.text = text
        self.column = column
        self.hint = hint


MAX_ERRORS = 100
"""The number of errors shown for one source; any more would add nothing new."""


@dataclass(slots=True)
class Log:
    """The diagnostics of one pass; `errorlevel` selects which warnings and notes are kept."""

    entries: dict[Diagnostic, None] = field(default_factory=dict)
    """Each once, in order."""
    level: int = 0
    """0 keeps all, 1 drops notes, 2 drops warnings too."""
    muted: frozenset[str] = frozenset()

    def add(self, entry: Diagnostic) -> None:
        if entry.severity != "error" and (entry.code in self.muted or self.level > _RANKS[entry.severity]):
            return
        self.entries[entry] = None

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        return tuple(entry for entry in self.entries if entry.severity == "error")[:MAX_ERRORS]

    @property
    def remarks(self) -> tuple[Diagnostic, ...]:
        return tuple(entry for entry in self.entries if entry.severity != "error")


_RANKS = {"note": 0, "warning": 1}
