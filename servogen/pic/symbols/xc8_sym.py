"""The .sym file of XC8, pic-as and HI-TECH C: symbols, segments and the lines of the source.

In: the text of the file. Out: `ProgramNames`; it tells where the words are, not which. A line is `name value
load-adjust class space`, numbers in hexadecimal (HI-TECH C, "Symbol File Format"; the fields as XC8's .cmf
explains them). Space 0 is the program, 1 is RAM; the symbols' addresses are of words, the segments' of bytes.
"""

from __future__ import annotations

import re

from servogen.pic.symbols.names import ProgramNames, damaged
from servogen.pic.symbols.xc8 import Xc8Program

_SYMBOL = re.compile(r"(?P<name>\S+) (?P<at>[0-9A-F]{1,8}) -?[0-9A-F]{1,8} (?P<kind>\w+) (?P<space>\d{1,3})")
_SEGMENT = re.compile(
    r"(?P<name>\S+) (?P<at>[0-9A-F]{1,8}) (?P<end>[0-9A-F]{1,8}) \w+ [0-9A-F]{1,8} (?P<space>\d{1,3})"
)
PROGRAM, RAM = "0", "1"
ABSOLUTE, NOWHERE = "ABS", ("ENTRY", "CONFIG")
SEGMENTS, LOCALS = "%segments", "%locals"
OBJECTS = (".o", ".obj")
MAX_LINE_DIGITS = 5


def read_xc8_sym(text: str, file: str) -> ProgramNames | None:
    """Return what a .sym file says; None if it does not say where all words are: it has no absolute sections
    of pic-as, whose .cmf and .elf do. Raises InputError that names the line.
    """
    found = Xc8Program()
    part, source = "", ""
    for number, line in enumerate(map(str.strip, text.splitlines()), 1):
        if line.startswith("%"):
            part = line
        elif part == SEGMENTS:
            segment = _SEGMENT.fullmatch(line)
            if segment is None:
                raise damaged(file, f"is not a segment of six fields: {line[:60]!r}", number)
            _segment(found, segment)
        elif (symbol := _SYMBOL.fullmatch(line)) is None:
            if part != LOCALS and line:
                raise damaged(file, f"is not a symbol of five fields: {line[:60]!r}", number)
            source = "" if line.lower().endswith(OBJECTS) else line
        elif part == LOCALS and symbol["name"].isdecimal():
            if len(symbol["name"]) <= MAX_LINE_DIGITS:
                found.line(int(symbol["at"], 16), source, int(symbol["name"]))
        else:
            _symbol(found, symbol)
    if part != LOCALS:
        raise damaged(file, f"ends before its part {LOCALS}", len(text.splitlines()) or 1)
    return found.names() if found.lines.keys() <= found.words.keys() else None


def _segment(found: Xc8Program, row: re.Match[str]) -> None:
    start, end = int(row["at"], 16), int(row["end"], 16) + 1
    if row["space"] == PROGRAM:
        found.section("program", start // 2, end // 2 - start // 2)
    elif row["space"] == RAM:
        found.section("ram", start, end - start)


def _symbol(found: Xc8Program, row: re.Match[str]) -> None:
    name, at, kind = row["name"], int(row["at"], 16), row["kind"]
    if kind == ABSOLUTE:
        found.symbol(name, at, "absolute")
    elif row["space"] == RAM:
        found.symbol(name, at, "ram")
    elif row["space"] == PROGRAM and kind not in NOWHERE:
        found.symbol(name, at, "program")
