"""The .cod file of gpasm, gplink and MPASM: blocks of 512 bytes with words, lines and symbols.

In: the bytes of the file. Out: `ProgramNames`. The layout is the one of gputils (libgputils/gpcod.h) and of
gpsim (src/cod.h): the first block is the directory, with the numbers of the others.
"""

from __future__ import annotations

from collections.abc import Iterator

from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.symbols.names import ProgramNames, by_address, damaged, in_ram

BLOCK = 512
WORDS = BLOCK // 2
FILE_NAMES, LINES, SYMBOLS = 430, 434, 462
"""Where the directory has the first and the last block of a table; both are 0 if it is empty."""
FILE_NAME_BYTES, LINE_BYTES = 64, 6
LINES_IN_BLOCK = 84
CODE, NO_CODE = 0x80, 0x10
"""Flags of a line: it belongs to the program; it made no words."""
MEMORY, ADDRESS = 2, 46
"""Types of symbols: a byte of RAM, and a place in the program."""


def read_cod(raw: bytes, file: str) -> ProgramNames:
    """Return what a .cod file says of the first 1024 words. Raises InputError."""
    if not raw or len(raw) % BLOCK:
        text = f"has {len(raw)} bytes, not whole blocks of {BLOCK}: it is no .cod, or incomplete"
        raise damaged(file, text)
    blocks = [raw[start : start + BLOCK] for start in range(0, len(raw), BLOCK)]
    labels, variables = [], set()
    for name, kind, value in _symbols(blocks, file):
        ram = in_ram(value)
        if kind == ADDRESS and value < PROGRAM_WORDS:
            labels.append((name, value))
        elif kind == MEMORY and ram is not None:
            variables.add((ram, name, 1))
    return ProgramNames(
        _words(blocks, file),
        by_address(labels),
        variables=tuple(sorted(variables)),
        lines=_lines(blocks, file),
    )


def _number(raw: bytes, at: int) -> int:
    return int.from_bytes(raw[at : at + 2], "little")


def _table(blocks: list[bytes], at: int, what: str, file: str) -> list[bytes]:
    first, last = _number(blocks[0], at), _number(blocks[0], at + 2)
    if not first and not last:
        return []
    if not 0 < first <= last < len(blocks):
        text = f"its {what} are in the blocks {first} to {last}, but it has {len(blocks)} blocks"
        raise damaged(file, text)
    return blocks[first : last + 1]


def _words(blocks: list[bytes], file: str) -> dict[int, int | None]:
    """Return the words. A word that is 0 may be none: the file fills the gaps of a block with zeros."""
    words: dict[int, int | None] = {}
    for index in range(PROGRAM_WORDS // WORDS):
        number = _number(blocks[0], 2 * index)
        if number >= len(blocks):
            raise damaged(file, f"its words are in block {number}, but it has {len(blocks)} blocks")
        for offset in range(WORDS if number else 0):
            if word := _number(blocks[number], 2 * offset):
                words[index * WORDS + offset] = word
    return words


def _symbols(blocks: list[bytes], file: str) -> Iterator[tuple[str, int, int]]:
    """Yield (name, type, value): a byte with the length, the name, two bytes and four, high byte first."""
    for block in _table(blocks, SYMBOLS, "symbols", file):
        at = 0
        while at < BLOCK and block[at]:
            end = at + 1 + block[at]
            if end + 6 > BLOCK:
                raise damaged(file, f"a symbol of {block[at]} letters exceeds its block")
            yield (
                block[at + 1 : end].decode("latin-1"),
                _number(block, end),
                int.from_bytes(block[end + 2 : end + 6], "big"),
            )
            at = end + 6


def _lines(blocks: list[bytes], file: str) -> dict[int, tuple[str, int]]:
    names = []
    for block in _table(blocks, FILE_NAMES, "source files", file):
        for at in range(0, BLOCK, FILE_NAME_BYTES):
            length = min(block[at], FILE_NAME_BYTES - 1)
            names.append(block[at + 1 : at + 1 + length].decode("latin-1"))
    lines = {}
    for block in _table(blocks, LINES, "lines", file):
        for at in range(0, LINES_IN_BLOCK * LINE_BYTES, LINE_BYTES):
            source, flags = block[at], block[at + 1]
            line, address = _number(block, at + 2), _number(block, at + 4)
            if not flags & CODE or flags & NO_CODE or not line or address >= PROGRAM_WORDS:
                continue
            if source >= len(names):
                raise damaged(file, f"line {line} is of source file {source}, but it names {len(names)}")
            lines[address] = (names[source], line)
    return lines
