"""What spans several lines: a macro's definition, an open IF, and the lines that are still to do.

In: the lines of a source or of a macro. Out: one line after the other, or the whole block up to its end.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from servogen.errors import Place
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.source import SourceLine, Statement


@dataclass(frozen=True, slots=True)
class Macro:
    name: str
    parameters: tuple[str, ...]
    body: tuple[SourceLine, ...]


@dataclass(slots=True)
class Condition:
    """An open IF: whether its lines count, whether a branch was taken, and where it began."""

    active: bool
    taken: bool
    place: Place
    seen_else: bool = False


@dataclass(frozen=True, slots=True)
class Placed:
    """A word that a line made; `is_code` tells an instruction from data."""

    address: int
    word: int
    line: SourceLine
    is_code: bool


class EndOfSource(Exception):
    """END was met."""


class ExitMacro(Exception):
    """EXITM was met."""


class OutOfBudget(Exception):
    """The source takes more work than any program of the chip; the log has the error."""


class TooManyErrors(Exception):
    """The rest of the source would say nothing new."""


class Reader:
    """The lines that are still to do at one level of nesting."""

    def __init__(self, lines: Sequence[SourceLine]) -> None:
        self._lines = lines
        self._index = 0

    def next(self) -> SourceLine | None:
        if self._index == len(self._lines):
            return None
        self._index += 1
        return self._lines[self._index - 1]

    def block(self, begin: str, end: str, opened: Statement) -> list[SourceLine]:
        """The lines up to the matching `end`, which is consumed; blocks of the same kind nest."""
        taken: list[SourceLine] = []
        depth = 1
        pattern = re.compile(rf"(?:[^\s;\"']+\s+|\s+)?({begin}|{end})\b(?!\s*[:=])", re.IGNORECASE)
        while (line := self.next()) is not None:
            if found := pattern.match(line.text.chars):
                depth += 1 if found[1].lower() == begin else -1
                if depth == 0:
                    return taken
            taken.append(line)
        raise SourceError(f"{opened.operation.upper()} without {end.upper()}", opened.column, number=129)
