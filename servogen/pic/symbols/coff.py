"""The .cof file of MPLINK and gplink: sections with their words and lines, and symbols.

In: the bytes of the file. Out: `ProgramNames`. The layout is Microchip's second one, as gputils describes it
(libgputils/gpcoff.h): a header, an optional header, the headers of the sections, the symbols with their
auxiliary entries of the same size, and the long names. Addresses are of words, sizes are of bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from struct import Struct, iter_unpack

from servogen.pic.device import PROGRAM_WORDS, RAM_LAST
from servogen.pic.symbols.names import ProgramNames, by_address, damaged, in_ram, sized, text_at, words_from

MAGIC = 0x1240
"""Of the layout with 20 bytes for a symbol; the older one has 18."""
_HEADER = Struct("<HHIIIHH")
_SECTION = Struct("<8sIIIIIIHHI")
_SYMBOL = Struct("<8sIhIBB")
_LINE = "<IHIHI"
LINE_BYTES = 16
TEXT, DATA, BSS, ROM_DATA = 0x20, 0x40, 0x80, 0x100
"""Flags of a section."""
EXTERNAL, STATIC, LABEL, FILE = 2, 3, 6, 103
"""Classes of a symbol; a name by EQU has another."""


def read_coff(raw: bytes, file: str) -> ProgramNames | None:
    """Return what a linked COFF file says of the first 1024 words; None for another layout. Raises
    InputError.
    """
    parts = _Parts(raw, file)
    if int.from_bytes(raw[:2], "little") != MAGIC:
        return None
    _, sections, _, symbols_at, symbols, optional, _ = _HEADER.unpack(parts.part(0, _HEADER.size, "header"))
    strings = symbols_at + symbols * _SYMBOL.size
    at = _HEADER.size + optional
    found = _Found()
    rows = list(_SECTION.iter_unpack(parts.part(at, sections * _SECTION.size, "sections")))
    kinds = [_kind(row[-1]) for row in rows]
    entries = parts.part(symbols_at, symbols * _SYMBOL.size, "symbols")
    files: dict[int, str] = {}
    for index, (name, value, section, _, role, _), extra in _symbols(entries):
        if role == FILE and extra:
            files[index] = parts.text(strings + int.from_bytes(extra[:4], "little"))
        elif role in (EXTERNAL, STATIC, LABEL) and 0 < section <= len(kinds):
            found.symbol(parts.name(name, strings), value, kinds[section - 1])
    for kind, (_, start, _, size, data_at, _, lines_at, _, lines, _) in zip(kinds, rows, strict=True):
        if kind == "data":
            found.sections.append(range(start & 0xFF, min((start & 0xFF) + size, RAM_LAST + 1)))
        elif kind == "program":
            found.words |= words_from(start, parts.part(data_at, size, "words"))
            for source, line, address, _, _ in iter_unpack(
                _LINE, parts.part(lines_at, lines * LINE_BYTES, "lines")
            ):
                if source in files and address < PROGRAM_WORDS and line:
                    found.lines[address] = (files[source], line)
    return ProgramNames(
        found.words,
        by_address(found.labels),
        variables=sized(found.variables, found.sections),
        lines=found.lines,
    )


def _kind(flags: int) -> str | None:
    if flags & (TEXT | ROM_DATA):
        return "program"
    return "data" if flags & (DATA | BSS) else None


@dataclass
class _Found:
    """What the sections and symbols so far have said."""

    words: dict[int, int | None] = field(default_factory=dict)
    labels: set[tuple[str, int]] = field(default_factory=set)
    variables: set[tuple[int, str]] = field(default_factory=set)
    sections: list[range] = field(default_factory=list)
    lines: dict[int, tuple[str, int]] = field(default_factory=dict)

    def symbol(self, name: str, value: int, kind: str | None) -> None:
        byte = in_ram(value)
        if kind == "program" and value < PROGRAM_WORDS:
            self.labels.add((name, value))
        elif kind == "data" and byte is not None:
            self.variables.add((byte, name))


def _symbols(entries: bytes) -> Iterator[tuple[int, tuple[bytes, int, int, int, int, int], bytes]]:
    """Yield the number of each symbol, its fields and its first auxiliary entry."""
    index, count = 0, len(entries) // _SYMBOL.size
    while index < count:
        at = index * _SYMBOL.size
        entry = _SYMBOL.unpack_from(entries, at)
        yield index, entry, entries[at + _SYMBOL.size : at + 2 * _SYMBOL.size] if entry[-1] else b""
        index += 1 + entry[-1]


class _Parts:
    """The parts of the file. In a real one no two overlap: together they are no longer than the file."""

    def __init__(self, raw: bytes, file: str) -> None:
        self._raw = raw
        self._file = file
        self._left = len(raw)

    def part(self, at: int, size: int, what: str) -> bytes:
        self._left -= size
        if at + size > len(self._raw) or self._left < 0:
            text = f"its {what}, {size} bytes at {at}, exceed its {len(self._raw)} bytes: it is incomplete"
            raise damaged(self._file, text)
        return self._raw[at : at + size]

    def name(self, short: bytes, strings: int) -> str:
        """Return the name of a symbol: eight bytes, or four zeros and where it is in the long names."""
        if short[:4] == bytes(4):
            return self.text(strings + int.from_bytes(short[4:], "little"))
        return short.rstrip(b"\0").decode("latin-1")

    def text(self, at: int) -> str:
        return text_at(self._raw, at)
