"""Lines of source with their locations, and the statement in a line.

In: the text of a file, or the body of a macro. Out: `SourceLine`s; `statement` splits one into label,
operation and operand field.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Protocol

from servogen.errors import Location
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.text import IDENTIFIER, Text

_OPERATION = re.compile(r"[#]?" + IDENTIFIER.pattern)
ASSIGNMENTS = ("<<=", ">>=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "=", "++", "--")
"""What may stand between a variable in column 1 and its new value."""

_ASSIGNMENT = re.compile(f"(?:{'|'.join(re.escape(operator) for operator in ASSIGNMENTS)})(?!=)")


@dataclass(frozen=True, slots=True)
class SourceLine:
    """One line. `within` names the macro calls that led to it, innermost first."""

    text: Text
    file: str
    number: int
    within: tuple[str, ...] = ()

    def place(self, column: int | None = None) -> Location:
        return Location(self.file, self.number, column)


def lines_of(text: str, file: str) -> list[SourceLine]:
    """Return the lines of a file, numbered from 1. A Ctrl-Z, as old editors write it, ends the file."""
    before, _, _ = text.partition("\x1a")
    rows = re.split(r"\r\n|\n|\r", before)
    return [SourceLine(Text.of(row.rstrip("\f")), file, number) for number, row in enumerate(rows, 1)]


@dataclass(frozen=True, slots=True)
class Statement:
    """A parsed line. `word` is the operation as written, empty if there is none."""

    line: SourceLine
    label: str | None
    label_column: int
    word: str
    column: int
    rest: Text

    @property
    def operation(self) -> str:
        return self.word.lower()

    @property
    def place(self) -> Location:
        return self.line.place(self.column)


class Vocabulary(Protocol):
    """Distinguishes operations from labels."""

    def is_operation(self, word: str) -> bool:
        """Return whether the word is a mnemonic, a directive or a macro."""
        ...

    def is_almost_operation(self, word: str) -> bool:
        """Return whether the word is so similar to an operation that it is probably a typing error."""
        ...


def statement(line: SourceLine, vocabulary: Vocabulary) -> Statement:
    """Return the parts of a line."""
    text = line.text.without_comment()
    label, label_column = None, 1
    rest = text.strip()
    match = IDENTIFIER.match(rest.chars)
    if match and _is_label(text, rest, match, vocabulary):
        label, label_column = match[0], rest.column(0)
        end = match.end() + (rest.chars[match.end() : match.end() + 1] == ":")
        rest = rest[end:].strip()
    operation = (label and _ASSIGNMENT.match(rest.chars)) or _OPERATION.match(rest.chars)
    if not operation:
        if rest:
            raise SourceError("asm-syntax", f"'{rest.chars[0]}' is not expected here", rest.column(0))
        return Statement(
            line=line, label=label, label_column=label_column, word="", column=rest.column(0), rest=rest
        )
    rest_after = rest[operation.end() :].strip()
    return Statement(
        line=line,
        label=label,
        label_column=label_column,
        word=operation[0],
        column=rest.column(0),
        rest=rest_after,
    )


_DEFINING = re.compile(r"\s+(?:equ|set|macro)\b|\s*=(?!=)", re.IGNORECASE)


def _is_label(text: Text, rest: Text, match: re.Match[str], vocabulary: Vocabulary) -> bool:
    """Return whether the first word is a label: in column 1, with a colon, or before EQU, SET, MACRO or =.

    As in MPASM, an indented word that is not an operation is a label too, alone or before an operation.
    """
    after = rest.chars[match.end() :]
    if after.startswith(":") or _DEFINING.match(after):
        return True
    if vocabulary.is_operation(match[0]):
        return False
    if not text.chars[:1].isspace():
        return True
    following = _OPERATION.match(after.strip())
    if following is None:
        return not after.strip() and not vocabulary.is_almost_operation(match[0])
    return vocabulary.is_operation(following[0])
