"""The .sym file of XC8 and HI-TECH C: symbols, segments and the lines of the C.

In: the text of the file. Out: `ProgramNames`; it tells where the words are, not which. A line is `name value
load-adjust class space`, numbers in hexadecimal (HI-TECH C, "Symbol File Format"; the fields as XC8's .cmf
explains them). Space 0 is the program, 1 is RAM; the symbols' addresses are of words, the segments' of bytes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from servogen.pic.device import PROGRAM_WORDS, RAM_LAST
from servogen.pic.symbols.names import ProgramNames, damaged, in_ram, sized

_SYMBOL = re.compile(r"(?P<name>\S+) (?P<at>[0-9A-F]{1,8}) -?[0-9A-F]{1,8} (?P<kind>\w+) (?P<space>\d{1,3})")
_SEGMENT = re.compile(
    r"(?P<name>\S+) (?P<at>[0-9A-F]{1,8}) (?P<end>[0-9A-F]{1,8}) \w+ [0-9A-F]{1,8} (?P<space>\d{1,3})"
)
_INTERNAL = re.compile(r"__|[lu]\d+$")
"""The names that the compiler and the linker give to places in the program."""
PROGRAM, RAM = "0", "1"
ABSOLUTE, NOWHERE = "ABS", ("ENTRY", "CONFIG")
SEGMENTS, LOCALS = "%segments", "%locals"
END = "__end_of"
"""`__end_of_main` is the address after the function `_main`."""
OBJECTS = (".o", ".obj")
MAX_LINE_DIGITS = 5


def read_xc8_sym(text: str, file: str) -> ProgramNames:
    """Return what a .sym file says. Raises InputError that names the line."""
    found = _Found()
    part, source = "", ""
    for number, line in enumerate(map(str.strip, text.splitlines()), 1):
        if line.startswith("%"):
            part = line
        elif part == SEGMENTS:
            segment = _SEGMENT.fullmatch(line)
            if segment is None:
                raise damaged(file, f"is not a segment of six fields: {line[:60]!r}", number)
            found.segment(segment)
        elif (symbol := _SYMBOL.fullmatch(line)) is None:
            if part != LOCALS and line:
                raise damaged(file, f"is not a symbol of five fields: {line[:60]!r}", number)
            source = "" if line.lower().endswith(OBJECTS) else line
        elif part == LOCALS and symbol["name"].isdecimal():
            found.line(symbol, source)
        else:
            found.symbol(symbol)
    if part != LOCALS:
        raise damaged(file, f"ends before its part {LOCALS}", len(text.splitlines()) or 1)
    return found.names()


@dataclass
class _Found:
    """What the lines so far have said."""

    words: dict[int, int | None] = field(default_factory=dict)
    code: dict[str, int] = field(default_factory=dict)
    variables: set[tuple[int, str]] = field(default_factory=set)
    marks: set[int] = field(default_factory=set)
    """Where the compiler's own blocks begin in RAM."""
    sections: list[range] = field(default_factory=list)
    lines: dict[int, tuple[str, int]] = field(default_factory=dict)

    def segment(self, row: re.Match[str]) -> None:
        start, end = int(row["at"], 16), int(row["end"], 16) + 1
        if row["space"] == PROGRAM:
            self.words |= dict.fromkeys(range(start // 2, min(end // 2, PROGRAM_WORDS)))
        elif row["space"] == RAM:
            self.sections.append(range(start, min(end, RAM_LAST + 1)))

    def line(self, row: re.Match[str], source: str) -> None:
        address = int(row["at"], 16)
        if address < PROGRAM_WORDS and source and len(row["name"]) <= MAX_LINE_DIGITS:
            self.lines[address] = (source, int(row["name"]))

    def symbol(self, row: re.Match[str]) -> None:
        name, at, kind = row["name"], int(row["at"], 16), row["kind"]
        byte = in_ram(at)
        if kind == ABSOLUTE or row["space"] == RAM:
            if byte is not None and _is_variable(name):
                self.variables.add((byte, name.replace("@", ".")))  # `main.i`, as this compiler lists it
            elif byte is not None and kind != ABSOLUTE:
                self.marks.add(byte)
        elif row["space"] == PROGRAM and kind not in NOWHERE and at < PROGRAM_WORDS:
            self.code.setdefault(name, at)

    def names(self) -> ProgramNames:
        labels = [(name, at) for name, at in self.code.items() if not _INTERNAL.match(name)]
        ends = {name: self.code.get(END + name, 0) for name in self.code}
        functions = [(name, at, ends[name]) for name, at in self.code.items() if at < ends[name]]
        return ProgramNames(
            self.words,
            tuple(sorted(labels, key=lambda label: (label[1], label[0]))),
            tuple(sorted(functions, key=lambda function: function[1])),
            sized(self.variables, self.sections, self.marks),
            self.lines,
        )


def _is_variable(name: str) -> bool:
    """Return whether a symbol in RAM is the program's: `_duty`, `main@i`; not the compiler's `btemp`,
    `__pcstackBANK0` and `??_main`.
    """
    return "@" in name or (name.startswith("_") and not name.startswith("__"))
