"""The .cmf file of XC8 and pic-as, which MPLAB X reads: sections, symbols and the lines of the source.

In: the text of the file. Out: `ProgramNames`; it tells where the words are, not which. Its comments describe
its parts; numbers are hexadecimal but for lines. Space 0 is the program, where a symbol's value is an address
of bytes, and any other address is of words; 1 is RAM.
"""

from __future__ import annotations

import re

from servogen.pic.symbols.names import ProgramNames, damaged
from servogen.pic.symbols.xc8 import Xc8Program

_HEX = r"[0-9A-F]{1,8}"
_PARTS = {
    "%PSECTS": re.compile(
        rf"(?P<name>\S+) (?P<kind>\S+) (?P<space>\d{{1,3}}) (?P<at>{_HEX}) {_HEX} (?P<size>{_HEX}) .*"
    ),
    "%LINETAB": re.compile(rf"(?P<at>{_HEX}) \S+ \S+ >(?P<line>\d{{1,5}}):(?P<source>.+)"),
    "%SYMTAB": re.compile(rf"(?P<name>\S+) (?P<at>{_HEX}) -?{_HEX} (?P<kind>\S+) (?P<space>\d{{1,3}}) .*"),
}
PROGRAM, RAM = "0", "1"
NOWHERE = ("ENTRY", "CONFIG")


def read_xc8_cmf(text: str, file: str) -> ProgramNames | None:
    """Return what a .cmf file says; None for another file. Raises InputError that names the line."""
    if not text.startswith("%CMF"):
        return None
    found = Xc8Program()
    part = ""
    for number, line in enumerate(map(str.strip, text.splitlines()), 1):
        if line.startswith("%"):
            part = line
        elif part in _PARTS and line and line[0] not in "#$":
            row = _PARTS[part].fullmatch(line)
            if row is None:
                raise damaged(file, f"is no line of {part}: {line[:60]!r}", number)
            _add(found, part, row)
    if part in ("%CMF", "%UNUSED", *_PARTS):
        raise damaged(file, "ends before the end of its part %SYMTAB", len(text.splitlines()))
    return found.names()


def _add(found: Xc8Program, part: str, row: re.Match[str]) -> None:
    at = int(row["at"], 16)
    if part == "%LINETAB":
        found.line(at, row["source"], int(row["line"]))
    elif part == "%PSECTS":
        if row["space"] in (PROGRAM, RAM):
            found.section("ram" if row["space"] == RAM else "program", at, int(row["size"], 16))
    elif row["kind"] == "ABS":
        found.symbol(row["name"], at, "absolute")
    elif row["space"] == RAM:
        found.symbol(row["name"], at, "ram")
    elif row["space"] == PROGRAM and row["kind"] not in NOWHERE:
        found.symbol(row["name"], at // 2, "program")
