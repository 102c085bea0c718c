"""The sections of relocatable sources, and where they lie on the chip.

In: the sections that the sources open, with their sizes. Out: the address of each. The rules are those of
gplink 1.4 with its scripts for these chips: sections at a stated address first; then code that the script
assigns to a page by name; then the others, the largest first. Each takes the smallest free block that it
fits, the lowest of equal ones. Sections of one name become one, in the order of the sources; those of
UDATA_OVR lie on each other.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

from servogen.errors import InputError, Location
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.source import SourceLine
from servogen.pic.device import (
    CONFIG_ADDRESS,
    EEPROM_ADDRESS,
    EEPROM_BYTES,
    ID_ADDRESS,
    ID_WORDS,
    PROGRAM_WORDS,
    RAM_FIRST,
    RAM_LAST,
)

Kind = Literal["code", "udata", "udata_shr", "udata_ovr", "idata"]
KINDS: tuple[Kind, ...] = ("code", "udata", "udata_shr", "udata_ovr", "idata")


@dataclass(slots=True)
class Section:
    """A section of one source. `origin` is its stated address, None if it can lie anywhere."""

    name: str
    kind: Kind
    origin: int | None
    place: Location
    size: int = 0
    base: int = 0
    used: int = 0
    """The words or bytes up to the current line of the pass."""
    furthest: int = 0
    """Those up to the furthest line: ORG of pic-as may go back."""
    data: list[tuple[int, SourceLine]] = field(default_factory=list)
    """The initial bytes of IDATA, each with the line that it is of."""
    copy: Section | None = None
    """The code with the initial bytes of IDATA, which gplink places as if it stood here."""
    block: str | None = None
    """The block of memory that a pic-as source names by a class; None for any that is not protected."""

    @property
    def is_code(self) -> bool:
        return self.kind == "code"

    def span(self) -> range:
        return range(self.base, self.base + self.size)


class Sections:
    """The sections of one source, in the order in which they were opened first."""

    def __init__(self) -> None:
        self._sections: dict[str, Section] = {}
        self.current: Section | None = None

    def __iter__(self) -> Iterator[Section]:
        return iter(self._sections.values())

    def __bool__(self) -> bool:
        return bool(self._sections)

    def named(self, name: str) -> Section | None:
        return self._sections.get(name)

    def begin(self) -> None:
        """Begin a pass."""
        self.current = None
        for section in self:
            section.used = section.furthest = 0
            section.data = []

    def open(self, name: str, kind: Kind, origin: int | None, place: Location) -> Section:
        """Open a section, or go on with it. Raises SourceError if it was another before."""
        section = self._sections.get(name)
        if section is None:
            section = self._sections[name] = Section(name, kind, origin, place, base=origin or 0)
        if (section.kind, section.origin) != (kind, origin):
            raise SourceError(
                "asm-section",
                f"section '{name}' is opened again, as another kind or at another address",
                place.column,
            )
        self.current = section
        return section

    def measured(self) -> None:
        """Take what the sections used in a pass as their sizes."""
        for section in self:
            section.size = section.furthest


@dataclass(frozen=True, slots=True)
class MemoryBlock:
    """A part of the memory, first and last address. A protected one holds only what is assigned to it."""

    name: str
    first: int
    last: int
    protected: bool = False


@dataclass(frozen=True, slots=True)
class LinkerScript:
    """What a linker script states."""

    code: tuple[MemoryBlock, ...]
    data: tuple[MemoryBlock, ...]
    assigned: Mapping[str, str] = field(default_factory=dict)
    """The block of a section, by the section's name."""
    at: Mapping[str, int] = field(default_factory=dict)
    """The address of a section, by the section's name, before that of the source."""
    from_top: bool = False
    """Code goes to the end of the highest block that it fits, as with pic-as."""


EVERY_CHIP = LinkerScript(
    (
        MemoryBlock("page", 0, PROGRAM_WORDS - 1),
        MemoryBlock(".idlocs", ID_ADDRESS, ID_ADDRESS + ID_WORDS - 1, True),
        MemoryBlock(".config", CONFIG_ADDRESS, CONFIG_ADDRESS, True),
        MemoryBlock("eedata", EEPROM_ADDRESS, EEPROM_ADDRESS + EEPROM_BYTES - 1, True),
    ),
    (MemoryBlock("gpr", RAM_FIRST, RAM_LAST),),
    {"PROG": "page", "IDLOCS": ".idlocs", "DEEPROM": "eedata"},
)

_ENTRY = re.compile(r"\s*(CODEPAGE|DATABANK|SHAREBANK|ACCESSBANK|SECTION)\b(.*)", re.IGNORECASE)
_VALUE = re.compile(r"(\w+)\s*=\s*([\w.]+)")


def read_script(script: str, file: str) -> LinkerScript:
    """Read a linker script (`.lkr`): CODEPAGE, DATABANK, SHAREBANK and SECTION. Raises InputError.

    Its other lines (LIBPATH, FILES, conditions) concern what the chip or the assembler has anyway.
    """
    code: list[MemoryBlock] = []
    data: list[MemoryBlock] = []
    assigned: dict[str, str] = {}
    for number, line in enumerate(script.splitlines(), 1):
        entry = _ENTRY.match(line.split("//")[0])
        if entry is None:
            continue
        values = {key.upper(): value for key, value in _VALUE.findall(entry[2])}
        kind = entry[1].upper()
        try:
            if kind == "SECTION":
                assigned[values["NAME"]] = values.get("ROM") or values["RAM"]
                continue
            first, last = (int(values[key], 0) for key in ("START", "END"))
            block = MemoryBlock(
                values["NAME"], first, last, bool(re.search(r"\bPROTECTED\b", entry[2], re.I))
            )
        except (KeyError, ValueError) as error:
            raise InputError(
                "asm-linker-script", f"{kind} lacks {error}", Location(file, number), "NAME=… START=… END=…"
            ) from error
        (code if kind == "CODEPAGE" else data).append(block)
    if not code:
        raise InputError("asm-linker-script", "has no CODEPAGE", Location(file))
    return LinkerScript(tuple(code), tuple(data), assigned)


_PLACED = re.compile(
    r"(?P<name>[^=\s]+)=(?:0x(?P<prefixed>[0-9a-f]{1,4})|(?P<hexadecimal>[0-9a-f]{1,5})h|(?P<decimal>[0-9]{1,4}))",
    re.I,
)


def read_place(option: str) -> tuple[str, int]:
    """Return the section and the address of `ISR=4h`, as pic-as's linker takes it. Raises InputError."""
    match = _PLACED.fullmatch(option)
    if match is None:
        raise InputError(
            "asm-linker-script", f"--place {option} is not a section and its address", hint="ISR=4h, ISR=0x4"
        )
    if match["decimal"]:
        return match["name"], int(match["decimal"])
    return match["name"], int(match["prefixed"] or match["hexadecimal"], 16)


def place(sources: Sequence[Sections], memory: LinkerScript) -> None:
    """Give every section its address. Raises InputError for one that has no room."""
    for is_code, blocks in ((True, memory.code), (False, memory.data)):
        sections = [section for each in sources for section in each]
        if is_code:
            sections = [each.copy or each for each in sections]
        groups = groups_of(section for section in sections if section.is_code == is_code)
        free = _Free()
        floating = []
        for group in groups:
            at = memory.at.get(group[0].name, group[0].origin)
            if at is not None:
                _put(group, free, at)
            elif _size(group):
                floating.append(group)
        # Sorting keeps the order of equal sizes.
        floating.sort(key=_size, reverse=True)
        for group in floating:
            if block := _assigned(group, memory):
                _move(group, free, [each for each in blocks if each.name == block])
        for group in floating:
            if not _assigned(group, memory):
                allowed = [block for block in blocks if not block.protected]
                _move(group, free, allowed, from_top=memory.from_top and is_code)


def groups_of(sections: Iterable[Section]) -> list[list[Section]]:
    """Return the sections that become one; what has a stated address stays by itself."""
    groups: dict[object, list[Section]] = {}
    for section in sections:
        key = section.name if section.origin is None else id(section)
        groups.setdefault(key, []).append(section)
    return list(groups.values())


def _size(group: Sequence[Section]) -> int:
    sizes = [section.size for section in group]
    return max(sizes) if group[0].kind == "udata_ovr" else sum(sizes)


def _assigned(group: Sequence[Section], memory: LinkerScript) -> str | None:
    return group[0].block or memory.assigned.get(group[0].name)


def _move(
    group: Sequence[Section], free: _Free, blocks: Sequence[MemoryBlock], *, from_top: bool = False
) -> None:
    """Move sections that become one to the smallest free block that they fit, or to the highest."""
    size = _size(group)
    fitting = [gap for gap in free.gaps(blocks) if len(gap) >= size]
    if not fitting:
        unit = "words" if group[0].is_code else "bytes"
        raise InputError(
            "asm-no-room",
            f"section '{group[0].name}' of {size} {unit} fits no free block of the chip's memory",
            group[0].place,
        )
    _put(group, free, fitting[-1].stop - size if from_top else min(fitting, key=len).start)


def _put(group: Sequence[Section], free: _Free, base: int) -> None:
    free.take(range(base, base + _size(group)))
    for section in group:
        section.base = base
        if section.kind != "udata_ovr":
            base += section.size


class _Free:
    """The addresses that nothing has taken."""

    def __init__(self) -> None:
        self._taken: set[int] = set()

    def take(self, addresses: range) -> None:
        self._taken.update(addresses)

    def gaps(self, blocks: Sequence[MemoryBlock]) -> Iterator[range]:
        """Yield the free ranges of the blocks, by address."""
        for block in sorted(blocks, key=lambda block: block.first):
            taken = sorted(each for each in self._taken if block.first <= each <= block.last)
            for before, after in pairwise([block.first - 1, *taken, block.last + 1]):
                if after - before > 1:
                    yield range(before + 1, after)
