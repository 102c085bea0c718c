"""The .lst file of gpasm and MPASM: each word beside its source line.

In: the text of the file. Out: `ProgramNames`. An included source is numbered from 1 again, without its name:
the lines are therefore those of the listing itself.
"""

from __future__ import annotations

import re
from pathlib import PurePath

from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.symbols.names import ProgramNames, by_address, damaged, in_ram

SIGNATURES = ("gpasm-", "MPASM")
_ROW = re.compile(
    r"(?:(?P<at>[0-9A-F]{4,6})(?P<words>(?:\s+[0-9A-F]{4})*)|\s+(?P<value>[0-9A-F]{8}))"
    r"\s+(?:\d{5}|M)(?: (?P<source>.*))?"
)
"""An address with its words, or a value; then the number of the source line, or that it is of a macro."""
_MORE_WORDS = re.compile(r"\s+[0-9A-F]{4}(?:\s+[0-9A-F]{4})*\s*")
_LABEL = re.compile(r"[A-Za-z_]\w*")
_ENTRY = re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*(:[^;,]*)?(;.*)?")
"""A line within CBLOCK with one name; EQU has more text."""


def read_gpasm_lst(text: str, file: str) -> ProgramNames | None:
    """Return what a listing says; None for one of another assembler, which has other columns. Raises
    InputError if it has no words.
    """
    if not text.lstrip("\f\r\n ").startswith(SIGNATURES):
        return None
    words: dict[int, int | None] = {}
    labels: dict[str, int] = {}
    variables, lines = set(), {}
    following = PROGRAM_WORDS
    for number, line in enumerate(text.splitlines(), 1):
        row = _ROW.fullmatch(line)
        if row is not None and row["value"]:
            byte, entry = in_ram(int(row["value"], 16)), _ENTRY.fullmatch(row["source"] or "")
            if byte is not None and entry is not None:
                variables.add((byte, entry["name"], 1))
        elif row is not None:
            following = int(row["at"], 16)
            label = _LABEL.match(row["source"] or "")
            if following < PROGRAM_WORDS and label is not None:
                labels.setdefault(label[0], following)
        elif not _MORE_WORDS.fullmatch(line):
            following = PROGRAM_WORDS
        for word in (line if row is None else row["words"] or "").split():
            if following < PROGRAM_WORDS:
                words[following] = int(word, 16)
                lines[following] = (PurePath(file).name, number)
                following += 1
    if not words:
        raise damaged(file, "has no words", 1)
    return ProgramNames(
        words,
        by_address(labels.items()),
        variables=tuple(sorted(variables)),
        lines=lines,
    )
