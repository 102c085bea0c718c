"""Files as makers' tools write them beside the HEX of one program, and the program."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from servogen.pic.assembler import assemble
from servogen.pic.image import Image

SOURCE = """\
        list p=16f84a
        cblock 0x0C
duty
count:2
        endc
        org 0
main    movlw 42
        movwf duty
loop    call delay
        goto loop
delay   movlw 7
        movwf count
        return
        end
"""
ROWS = {0: 7, 1: 8, 2: 9, 3: 10, 4: 11, 5: 12, 6: 13}
"""The line of each word in SOURCE, counted by hand."""

SYM = """\
_main 0 0 CODE 0
__end_of_main 4 0 CODE 0
_delay 4 0 CODE 0
__end_of_delay 7 0 CODE 0
__pmaintext 0 0 CODE 0
_PORTB 6 0 ABS 0
btemp 4E 0 ABS 0
_fixed 20 0 ABS 0
_duty C 0 BANK0 1
_count D 0 BANK0 1
delay@n 10 0 BANK0 1
??_delay 11 0 BANK0 1
___sp 0 0 STACK 2
intlevel0 0 0 ENTRY 0
%segments
maintext 0 D CODE 0 0
bssBANK0 C E BANK0 C 1
cstackBANK0 F 12 BANK0 F 1
%locals
dist/default/production\\startup.o
dist/default/production\\main.o
C:\\Users\\a user\\main.c
12 0 0 CODE 0
13 2 0 CODE 0
l77 2 0 CODE 0
20 4 0 CODE 0
"""
"""What XC8 writes, for a C program with the words of SOURCE."""

MAP = """\
gplink-1.4.0 #1107 (Jan  1 2021)
Map File - Created 11-28-2026  00:42:11

                                 Section Info
                  Section       Type    Address   Location Size(Bytes)
                ---------  ---------  ---------  ---------  ---------
                   code_m       code   0x000000    program   0x00000e
                udata_s_0      udata   0x00000c       data   0x000003

                              Program Memory Usage
                               Start         End
                           ---------   ---------
                            0x000000    0x000006
                            7 program addresses used

                              Symbols - Sorted by Name
                     Name    Address   Location    Storage File
                ---------  ---------  ---------  --------- ---------
                   _count   0x00000d       data     static main.asm
                   _delay   0x000004    program     static main.asm
                    _duty   0x00000c       data     extern main.asm
                    _main   0x000000    program     extern main.asm
"""
"""What gplink writes for SDCC."""


def image_of(source: str = SOURCE) -> Image:
    return assemble(source).image


def cod_of(image: Image) -> bytes:
    """A .cod with two variables, a label and the line of each word, block by block as gputils has it."""
    directory, words, names, lines, symbols = (bytearray(512) for _ in range(5))
    directory[0] = 1
    for at, first in ((430, 2), (434, 3), (462, 4)):
        directory[at] = directory[at + 2] = first
    for address, word in image.program.items():
        words[2 * address : 2 * address + 2] = word.to_bytes(2, "little")
    names[:9] = b"\x08prog.asm"
    rows = [(0xFF, 1, 0), (0x90, 6, 0), *((0x80, line, address) for address, line in ROWS.items())]
    for index, (flags, line, address) in enumerate(rows):
        lines[6 * index : 6 * index + 6] = bytes([0, flags, line, 0, address, 0])
    at = 0
    for name, kind, value in ((b"duty", 2, 0x0C), (b"count", 2, 0x8D), (b"delay", 46, 4), (b"w", 47, 0x10)):
        entry = bytes([len(name)]) + name + kind.to_bytes(2, "little") + value.to_bytes(4, "big")
        symbols[at : at + len(entry)] = entry
        at += len(entry)
    return b"".join(map(bytes, (directory, words, names, lines, symbols)))


COF = (Path(__file__).parent / "linked.cof").read_bytes()
"""What gplink -c writes for linked.asm, which has the words of SOURCE in the same lines."""

CMF = """\
%CMF
# %PSECTS Section
%PSECTS
$dist/default/production\\main.o
maintext CODE 0 0 0 7 2 1
bssBANK0 BANK0 1 C C 3 1 1
config CONFIG 4 2007 2007 1 2 1
%UNUSED
RAM 1E-4D 1
%LINETAB
$dist/default/production\\main.o
0 maintext CODE >12:C:\\Users\\a user\\main.c
2 maintext CODE >13:C:\\Users\\a user\\main.c
4 maintext CODE >20:C:\\Users\\a user\\main.c
%SYMTAB
_main 0 0 CODE 0 maintext main.o
__end_of_main 8 0 CODE 0 maintext main.o
_delay 8 0 CODE 0 maintext main.o
__end_of_delay E 0 CODE 0 maintext main.o
_RB0 30 0 ABS 0 - main.o
_duty C 0 BANK0 1 bssBANK0 main.o
_count D 0 BANK0 1 bssBANK0 main.o
%SPLITSTAB
"""
"""What XC8 writes, for a C program with the words of SOURCE; an address of code is twice that of a word."""


def elf_of(image: Image, version: int = 3, more: bytes = b"") -> bytes:
    """An .elf as XC8 has it, with what CMF says and the words; its lines in a version of DWARF, then more."""
    words = b"".join(word.to_bytes(2, "little") for word in image.program.values())
    names = b"\0_main\0__end_of_main\0_delay\0__end_of_delay\0_RB0\0_duty\0_count\0"
    where = {"_main": (0, 1), "__end_of_main": (4, 0xFFF1), "_delay": (4, 1), "__end_of_delay": (7, 0xFFF1)}
    where |= {"_RB0": (0x30, 0xFFF1), "_duty": (0x0C, 2), "_count": (0x0D, 2)}
    symbols = bytes(16) + b"".join(
        _fields((names.index(name.encode() + b"\0"), 4), (at, 4), (0, 4), (0x10, 2), (section, 2))
        for name, (at, section) in where.items()
    )
    texts = b"\0maintext\0bssBANK0\0.strtab\0.symtab\0.debug_line\0.shstrtab\0"
    parts: list[tuple[str, int, int, bytes]] = [
        ("maintext", 1, 0, words),
        ("bssBANK0", 8, 0x0C, bytes(3)),
        (".strtab", 3, 0, names),
        (".symtab", 2, 0, symbols),
        (".debug_line", 7, 0, _line_program(version, more)),
        (".shstrtab", 3, 0, texts),
    ]
    body = b"".join(data for _, kind, _, data in parts if kind != 8)
    headers = bytes(40) + b"".join(_section_headers(parts, texts))
    head = b"\x7fELF\1\1\1".ljust(16, b"\0")
    head += _fields((2, 2), (204, 2), (1, 4), (0, 4), (0, 4), (52 + len(body), 4), (5, 4))
    return head + _fields((52, 2), (32, 2), (0, 2), (40, 2), (7, 2), (6, 2)) + body + headers


def _section_headers(parts: list[tuple[str, int, int, bytes]], texts: bytes) -> Iterator[bytes]:
    at = 52
    for name, kind, start, data in parts:
        place = (at, 4), (len(data), 4)
        yield _fields((texts.index(name.encode()), 4), (kind, 4), (0, 4), (start, 4), *place, *((0, 4),) * 4)
        at += 0 if kind == 8 else len(data)


def _line_program(version: int, more: bytes) -> bytes:
    """Lines 12, 13 and 20 at the words 0, 2 and 4: an address, advances of both, and special operations."""
    files = b"\0main.c\0\0\0\0\0"
    operations = [1] if version >= 4 else []  # of a long instruction word
    header = bytes([1, *operations, 1, 0xF6, 0xF5, 10, 0, 1, 1, 1, 1, 0, 0, 0, 1]) + files
    steps = bytes([0, 3, 2, 0, 0, 3, 11, 1, 3, 1, 2, 2, 1, 3, 7, 2, 2, 1, 2, 3, 0, 1, 1])
    unit = _fields((version, 2), (len(header), 4)) + header + steps + more
    return _fields((len(unit), 4)) + unit


def _fields(*values: tuple[int, int]) -> bytes:
    return b"".join(value.to_bytes(size, "little") for value, size in values)


BESIDE = {
    ".cod": cod_of(image_of()),
    ".cof": COF,
    ".cmf": CMF.encode(),
    ".elf": elf_of(image_of()),
    ".map": MAP.encode(),
    ".sym": SYM.encode(),
}
"""A good file of each format that has no other test of mutants."""
