"""Constructs that span several lines: a macro's definition, an open IF, and the lines still to be processed.

In: the lines of a source or of a macro. Out: one line after the other, or the whole block up to its end.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from servogen.errors import Location
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.source import SourceLine, Statement


@dataclass(frozen=True, slots=True)
class Macro:
    name: str
    parameters: tuple[str, ...]
    body: tuple[SourceLine, ...]


@dataclass(slots=True)
class Condition:
    """An open IF: whether its lines are assembled, whether a branch was taken, and where it began."""

    active: bool
    taken: bool
    place: Location
    seen_else: bool = False


@dataclass(frozen=True, slots=True)
class Placed:
    """A word placed by a line; `is_code` distinguishes an instruction from data."""

    address: int
    word: int
    line: SourceLine
    is_code: bool


class EndOfSource(Exception):
    """Raised when END is reached."""


class ExitMacro(Exception):
    """Raised when EXITM is reached."""


class OutOfBudget(Exception):
    """Raised when the source takes more work than any program of the chip; the log has the error."""


class TooManyErrors(Exception):
    """Raised when so many errors have been found that more would be of no use."""


class LineReader:
    """The lines still to be processed at one level of nesting."""

    def __init__(self, lines: Sequence[SourceLine]) -> None:
        self._lines = lines
        self._index = 0

    def next(self) -> SourceLine | None:
        if self._index == len(self._lines):
            return None
        self._index += 1
        return self._lines[self._index - 1]

    def block(self, begin: str, end: str, opened: Statement) -> list[SourceLine]:
        """Return the lines up to the matching `end`, which is consumed; blocks of the same kind nest.

        `begin` is a pattern of the words that open one.
        """
        taken: list[SourceLine] = []
        depth = 1
        pattern = re.compile(rf"(?:[^\s;\"']+\s+|\s+)?({begin}|{end})\b(?!\s*[:=])", re.IGNORECASE)
        while (line := self.next()) is not None:
            if bracket := pattern.match(line.text.chars):
                depth += -1 if bracket[1].lower() == end else 1
                if depth == 0:
                    return taken
            taken.append(line)
        raise SourceError(
            "asm-unclosed-block", f"{opened.operation.upper()} without {end.upper()}", opened.column
        )
