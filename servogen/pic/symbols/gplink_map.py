"""The .map file of gplink (also for SDCC) and MPLINK: sections and all symbols, static ones too.

In: the text of the file. Out: `ProgramNames`; it tells where the words are, not which.
"""

from __future__ import annotations

import re

from servogen.pic.device import PROGRAM_WORDS, RAM_LAST
from servogen.pic.symbols.names import ProgramNames, by_address, damaged, in_ram, sized

SIGNATURES = ("gplink", "MPLINK")
SECTIONS, PROGRAM, SYMBOLS = "Section Info", "Program Memory Usage", "Symbols"
"""The headings of the tables; the symbols come twice, by name and by address."""
_PLACE = r"\s+0x(?P<at>[0-9a-f]{1,8})\s+(?P<where>program|data)\s+"
_SECTION = re.compile(rf"\s*\S.{{0,999}}?\s\w+{_PLACE}0x(?P<size>[0-9a-f]{{1,8}})", re.IGNORECASE)
_SYMBOL = re.compile(rf"\s*(?P<name>\S+){_PLACE}(?:static|extern)\b", re.IGNORECASE)
_RULE = re.compile(r"[\s-]*|\s*(?:Section|Name|Start)\s.*")


def read_gplink_map(text: str, file: str) -> ProgramNames | None:
    """Return what a map file says; None for one of XC8 or another linker. Raises InputError that names the
    line.
    """
    if not text.lstrip().startswith(SIGNATURES):
        return None
    words: dict[int, int | None] = {}
    sections, labels, found = [], set(), set()
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        heading = line.strip()
        if heading.startswith((SECTIONS, PROGRAM, SYMBOLS)):
            table = heading
        elif _RULE.fullmatch(line) or not table or table.startswith(PROGRAM):
            continue
        elif table.startswith(SECTIONS):
            row = _row(_SECTION, line, file, number, "a section: name, type, address, location and size")
            at, size = int(row["at"], 16), int(row["size"], 16)
            if row["where"] == "program":
                words |= dict.fromkeys(range(at, min(at + size // 2, PROGRAM_WORDS)))
            elif (start := in_ram(at)) is not None:
                sections.append(range(start, min(start + size, RAM_LAST + 1)))
        else:
            row = _row(_SYMBOL, line, file, number, "a symbol: name, address, location and storage")
            at = int(row["at"], 16)
            if row["where"] == "program" and at < PROGRAM_WORDS:
                labels.add((row["name"], at))
            elif row["where"] == "data" and (ram := in_ram(at)) is not None:
                found.add((ram, row["name"]))
    if not table.startswith(SYMBOLS):
        raise damaged(file, "ends before its table of symbols", len(text.splitlines()) or 1)
    return ProgramNames(
        words,
        by_address(labels),
        variables=sized(found, sections),
    )


def _row(pattern: re.Pattern[str], line: str, file: str, number: int, what: str) -> re.Match[str]:
    match = pattern.match(line)
    if match is None:
        raise damaged(file, f"is not {what}: {line.strip()[:60]!r}", number)
    return match
