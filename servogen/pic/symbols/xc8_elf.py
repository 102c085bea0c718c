"""The .elf file of XC8 and pic-as: sections with their words, symbols, and lines in DWARF.

In: the bytes of the file. Out: `ProgramNames`. ELF32 with the low byte first (System V ABI, chapter 4), for
machine 204, with the line programs of DWARF 2 to 4 (section 6.2). Addresses are of words in the program and
of bytes in RAM, which has the sections without contents. An address of DWARF has two bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from struct import Struct

from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.symbols.names import ProgramNames, damaged, text_at, words_from
from servogen.pic.symbols.xc8 import END, Space, Xc8Program

MAGIC = b"\x7fELF\x01\x01"
MACHINE_AT, MACHINE = 18, 204
"""Microchip's 8-bit PIC."""
_HEADER = Struct("<16sHHIIIIIHHHHHH")
_SECTION = Struct("<IIIIIIIIII")
_SYMBOL = Struct("<IIIBBH")
CONTENTS, SYMBOLS, NO_CONTENTS = 1, 2, 8
"""Types of sections."""
ABSOLUTE = 0xFFF1
"""The section of a symbol that is in none."""
VERSIONS = range(2, 5)
ADDRESS_BYTES = 4
"""More of an address are not read: a number of a whole file would be slow to count with."""


@dataclass(frozen=True, slots=True)
class _Section:
    name: str
    kind: int
    start: int
    size: int
    data: bytes


def read_xc8_elf(raw: bytes, file: str) -> ProgramNames | None:
    """Return what an .elf file says; None for one of another machine. Raises InputError."""
    if not raw.startswith(MAGIC) or raw[MACHINE_AT : MACHINE_AT + 2] != MACHINE.to_bytes(2, "little"):
        return None
    sections = _sections(_Bytes(raw, file), len(raw))
    found = Xc8Program()
    for section in sections:
        if section.kind == CONTENTS:
            words = words_from(section.start, section.data)
            found.section("program", section.start, len(words), words)
        elif section.kind == NO_CONTENTS:
            found.section("ram", section.start, section.size)
    names = next((section.data for section in sections if section.name == ".strtab"), b"")
    for section in sections:
        if section.kind == SYMBOLS:
            for name, at, _, _, _, index in _SYMBOL.iter_unpack(
                section.data[: len(section.data) // _SYMBOL.size * _SYMBOL.size]
            ):
                text = text_at(names, name)
                found.symbol(text, at, _space(sections, index, text))
        elif section.name == ".debug_line":
            _line_programs(_Bytes(section.data, file), found)
    return found.names()


def _space(sections: list[_Section], index: int, name: str) -> Space:
    if index == ABSOLUTE or index >= len(sections):  # the end of a function may lie after its section
        return "program" if name.startswith(END) else "absolute"
    return "program" if sections[index].kind == CONTENTS else "ram"


def _sections(raw: _Bytes, size: int) -> list[_Section]:
    """Return the sections. In a real file no two overlap: together they are no longer than the file."""
    header = _HEADER.unpack(raw.take(_HEADER.size))
    at, count, names = header[6], header[12], header[13]
    rows = [_SECTION.unpack(raw.at(at + index * _SECTION.size).take(_SECTION.size)) for index in range(count)]
    filled = [row for row in rows if row[1] != NO_CONTENTS]
    if sum(row[5] for row in filled) > size or not names < count:
        raise raw.damage("its sections exceed it: it is incomplete")
    texts = raw.at(rows[names][4]).take(rows[names][5])
    return [
        _Section(
            text_at(texts, name), kind, start, size, b"" if kind == NO_CONTENTS else raw.at(place).take(size)
        )
        for name, kind, _, start, place, size, *_ in rows
    ]


@dataclass
class _Row:
    """The registers of a line program that lines come from."""

    address: int = 0
    file: int = 1
    line: int = 1


def _line_programs(raw: _Bytes, found: Xc8Program) -> None:
    while raw.left:
        size = raw.number(4)
        unit = raw.part(size)
        version = unit.number(2)
        if version in VERSIONS:
            _line_program(unit, version, found)


def _line_program(raw: _Bytes, version: int, found: Xc8Program) -> None:
    program_at = raw.number(4) + raw.position
    step = raw.number(1)
    if version >= 4:
        raw.skip(1)  # the operations of a long instruction word
    raw.skip(1)  # whether a row begins a statement at first: each counts
    base, line_range, first_special = raw.signed(1), raw.number(1), raw.number(1)
    operands = [raw.number(1) for _ in range(first_special - 1)]
    while raw.text():  # the folders: a source is found by its name
        pass
    files = []
    while name := raw.text():
        files.append(name)
        for _ in range(3):
            raw.variable()
    raw.at(program_at)
    row = _Row()

    def note() -> None:
        if 0 < row.file <= len(files) and 0 <= row.address < PROGRAM_WORDS and 0 < row.line <= 0xFFFFF:
            found.line(row.address, files[row.file - 1], row.line)

    while raw.left:
        code = raw.number(1)
        if code >= first_special:
            advance, line = divmod(code - first_special, line_range or 1)
            row.address += advance * step
            row.line += base + line
            note()
        elif code == 0:
            extended = raw.part(raw.variable())
            kind = extended.number(1)
            if kind == 1:
                row = _Row()
            elif kind == 2:
                row.address = extended.number(min(extended.left, ADDRESS_BYTES))
        elif code == 1:
            note()
        elif code == 2:
            row.address += raw.variable() * step
        elif code == 3:
            row.line += raw.variable(signed=True)
        elif code == 4:
            row.file = raw.variable()
        elif code == 8:
            row.address += (255 - first_special) // (line_range or 1) * step
        elif code == 9:
            row.address += raw.number(2)
        else:
            for _ in range(operands[code - 1]):
                raw.variable()


class _Bytes:
    """A part of the file, read from its beginning on."""

    def __init__(self, raw: bytes, file: str) -> None:
        self._raw = raw
        self._file = file
        self.position = 0

    @property
    def left(self) -> int:
        return len(self._raw) - self.position

    def at(self, position: int) -> _Bytes:
        self.position = position
        return self

    def take(self, size: int) -> bytes:
        if size > self.left:
            raise self.damage("ends within one of its tables: it is incomplete")
        self.position += size
        return self._raw[self.position - size : self.position]

    def skip(self, size: int) -> None:
        self.take(size)

    def part(self, size: int) -> _Bytes:
        return _Bytes(self.take(size), self._file)

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def signed(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little", signed=True)

    def variable(self, *, signed: bool = False) -> int:
        """Return a number of seven bits per byte, the lowest first (DWARF, "LEB128"), of up to 63 bits."""
        value = shift = 0
        while shift < 63:
            byte = self.number(1)
            value |= (byte & 0x7F) << shift
            shift += 7
            if not byte & 0x80:
                return value - (1 << shift) if signed and byte & 0x40 else value
        raise self.damage("a number in its lines has more than 63 bits")

    def text(self) -> str:
        end = self._raw.find(b"\0", self.position)
        if end < 0:
            raise self.damage("ends within a name: it is incomplete")
        return self.take(end + 1 - self.position)[:-1].decode("latin-1")

    def damage(self, problem: str) -> Exception:
        return damaged(self._file, problem)
