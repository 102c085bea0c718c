"""A source line whose characters remember their columns, so that locations survive substitution.

In: a source line. Out: slices and replacements of it; `columns[i]` is the column, counted from 1, of
character `i` in the file. Text inserted by a macro or a `#define` has the column of the text it replaces.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from servogen.pic.assembler.messages import SourceError

IDENTIFIER = re.compile(r"[.]?[A-Za-z_?@\u0080-\U0010FFFF][\w.?@]*")
"""A name as MPASM spells it. A `.` in front must be followed by a letter, or it is a decimal number."""

_QUOTED = re.compile(r'"(?:\\.|[^"\\])*"?' + r"|'(?:\\[^\s]|[^'\\])[^' ,;]*'")
"""A string, or a quoted number or character: what no substitution and no comment may touch."""
_CLOSED = re.compile(r'"(?:\\.|[^"\\])*"')


MAX_LINE = 2000
"""Characters of a line, with what macros and `#define` put into it; MPASM takes 200."""


def line_too_long(column: int) -> SourceError:
    return SourceError("asm-syntax", f"the line has more than {MAX_LINE} characters", column)


@dataclass(frozen=True, slots=True)
class Text:
    chars: str
    columns: tuple[int, ...]

    @classmethod
    def of(cls, line: str, first: int = 1) -> Text:
        """Return a line of a file; `first` is the column of its first character."""
        return cls(line, tuple(range(first, first + len(line))))

    def __getitem__(self, part: slice) -> Text:
        return Text(self.chars[part], self.columns[part])

    def __bool__(self) -> bool:
        return bool(self.chars)

    def column(self, index: int) -> int:
        """Return the column of a character; for the end of the text, one after its last."""
        if index < len(self.columns):
            return self.columns[index]
        return self.columns[-1] + 1 if self.columns else 1

    def strip(self) -> Text:
        start = len(self.chars) - len(self.chars.lstrip())
        return self[start : max(start, len(self.chars.rstrip()))]

    def replace(self, start: int, end: int, chars: str) -> Text:
        """Return this text with `chars` in place of `start` to `end`. Raises SourceError."""
        if len(self.chars) - (end - start) + len(chars) > MAX_LINE:
            raise line_too_long(self.column(start))
        columns = (self.column(start),) * len(chars)
        return Text(
            self.chars[:start] + chars + self.chars[end:],
            self.columns[:start] + columns + self.columns[end:],
        )

    def quoted(self) -> list[tuple[int, int]]:
        """Return (start, end) of each string and quoted number."""
        return [match.span() for match in _QUOTED.finditer(self.chars)]

    def unclosed(self) -> int | None:
        """Return the column of a double quote without a closing one; None if there is none."""
        for start, end in self.quoted():
            body = self.chars[start:end]
            if body.startswith('"') and not _CLOSED.fullmatch(body):
                return self.column(start)
        return None

    def without_comment(self) -> Text:
        for index in self._outside(";"):
            return self[:index]
        return self

    def split(self, separator: str) -> list[Text]:
        """Return the stripped parts between the separators outside strings."""
        parts, start = [], 0
        for index in self._outside(separator):
            parts.append(self[start:index].strip())
            start = index + 1
        return [*parts, self[start:].strip()]

    def _outside(self, sign: str) -> Iterator[int]:
        if sign not in self.chars:
            return
        spans = self.quoted()
        for index, char in enumerate(self.chars):
            if char == sign and not any(start <= index < end for start, end in spans):
                yield index
