"""`Image`: the contents of a chip (program, configuration word, data EEPROM, ID words), from and to Intel
HEX.

In: a HEX file in the format of programmers, INHX8M: each word is two bytes, low byte first, at twice its
address (DS30262, section 3; EEPROM bytes are words from 0x2100 on). Out: an `Image`, or one clear error.
"""

from __future__ import annotations

import io
import re
import string
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from intelhex import IntelHex, IntelHexError

from servogen.errors import Diagnostic, InputError, Location
from servogen.pic.device import (
    CONFIG_ADDRESS,
    EEPROM_ADDRESS,
    EEPROM_BYTES,
    ERASED_WORD,
    ID_ADDRESS,
    ID_WORDS,
    PROGRAM_WORDS,
)
from servogen.pic.isa import WORD_MASK

Words = Mapping[int, int]
"""Addresses and values; an address that is not there was never programmed."""


def _frozen(words: Words) -> Words:
    return MappingProxyType(dict(sorted(words.items())))


@dataclass(frozen=True, slots=True)
class Image:
    """The contents of one chip. `program` and `eeprom` are indexed by address from 0, `ids` by number 0
    to 3.
    """

    program: Words
    config: int | None = None
    eeprom: Words = field(default_factory=dict)
    ids: Words = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("program", "eeprom", "ids"):
            object.__setattr__(self, name, _frozen(getattr(self, name)))

    def __repr__(self) -> str:
        config = "none" if self.config is None else f"0x{self.config:04X}"
        return f"<Image of {self.words} words, configuration {config}>"

    def __reduce__(self) -> tuple[type[Image], tuple[object, ...]]:
        """Return how to reconstruct the image in another process, because its mappings cannot be pickled."""
        return Image, (dict(self.program), self.config, dict(self.eeprom), dict(self.ids))

    @property
    def words(self) -> int:
        """Return the number of program words used."""
        return len(self.program)

    @property
    def chip_config(self) -> int:
        """Return the configuration word of the programmed chip: erased unless the file has one, which is RC
        oscillator, watchdog on, power-up timer off (DS35007 section 6.1).
        """
        return ERASED_WORD if self.config is None else self.config

    def flash(self) -> list[int]:
        """Return all program words of the chip, with erased ones as the chip reads them."""
        return [self.program.get(address, ERASED_WORD) for address in range(PROGRAM_WORDS)]


@dataclass(frozen=True, slots=True)
class Region:
    """A part of the HEX file's address space, in words."""

    name: str
    start: int
    length: int
    largest: int

    @property
    def span(self) -> str:
        return f"0x{self.start:04X}-0x{self.start + self.length - 1:04X}"


RESERVED = range(ID_ADDRESS + ID_WORDS, CONFIG_ADDRESS)
"""Between the ID words and the configuration word: DS30262 section 2.1."""

REGIONS = (
    Region("program", 0, PROGRAM_WORDS, WORD_MASK),
    Region("ids", ID_ADDRESS, ID_WORDS, WORD_MASK),
    Region("config", CONFIG_ADDRESS, 1, WORD_MASK),
    Region("eeprom", EEPROM_ADDRESS, EEPROM_BYTES, 0xFF),
)


@dataclass(frozen=True, slots=True)
class HexFile:
    """The contents of a HEX file, and harmless but unusual findings as sentences with their lines."""

    image: Image
    remarks: tuple[Diagnostic, ...]


def from_hex(text: str, file: str | None = None) -> Image:
    """Return the image in the text of an Intel HEX file. Raises InputError that names file, line and
    address.
    """
    return read_hex(text, file).image


def read_hex(text: str, file: str | None = None) -> HexFile:
    """Return the image and the findings in a HEX file written by a compiler, assembler or programmer.

    Harmless, but reported: an erased word as 0xFFFF, the upper two bits of the configuration word as 1, words
    in the reserved places 0x2004-0x2006 (a read-out has the device ID there). The upper byte of an EEPROM
    word is ignored (DS30262 section 3). Lines that begin with `;` are comments, even after the end. Raises
    InputError.
    """
    remarks: list[Diagnostic] = []
    words: dict[int, int] = {}
    for address, halves in sorted(_words(_records(text, file), file).items()):
        place = Location(file, halves.line)
        if address in RESERVED:
            text = f"word 0x{address:04X} is reserved and omitted"
            remarks.append(Diagnostic("warning", "hex-word", text, place))
            continue
        region = _region(address, place)
        if halves.low is None or halves.high is None:
            which = "low" if halves.low is None else "high"
            raise InputError("hex-syntax", f"word 0x{address:04X} has no {which} byte", place)
        value = halves.low | halves.high << 8
        if value > region.largest and region.name != "eeprom":
            if value != 0xFFFF and (region.name != "config" or value < 0xC000):
                raise InputError(
                    "hex-syntax",
                    f"word 0x{address:04X} is 0x{value:04X}; the {region.name} area holds at most "
                    f"0x{region.largest:04X}",
                    place,
                )
            text = f"word 0x{address:04X} is 0x{value:04X}: its upper two bits are omitted"
            remarks.append(Diagnostic("warning", "hex-word", text, place))
        words[address] = value & region.largest
    return HexFile(image_of(words), tuple(remarks))


def to_hex(image: Image) -> str:
    """Return the Intel HEX file of an image. The same image always gives the same text."""
    memory = IntelHex()
    config = {} if image.config is None else {0: image.config}
    for region, words in zip(REGIONS, (image.program, image.ids, config, image.eeprom), strict=True):
        for offset, value in words.items():
            memory[2 * (region.start + offset)] = value & 0xFF
            memory[2 * (region.start + offset) + 1] = value >> 8
    text = io.StringIO()
    memory.write_hex_file(text)
    return text.getvalue()


@dataclass(slots=True)
class _Halves:
    """The two bytes of a word as they are read, and the line of the last."""

    low: int | None = None
    high: int | None = None
    line: int = 0


@dataclass(frozen=True, slots=True)
class _Record:
    line: int
    memory: IntelHex


MAX_RECORDS = 10_000
"""The maximum number of records of a file; with one byte per record, a full chip has 2200."""

_DATA, _END = "00", "01"
_BASES = ("02", "04")
"""Extended segment and linear addresses: they count for the records that follow."""


def _records(text: str, file: str | None) -> list[_Record]:
    """Return each data record, parsed by intelhex one at a time, so that an error can name its line."""
    records: list[_Record] = []
    base = ""
    count = 0
    ended = False
    for number, raw in enumerate(re.split("\r\n|\n|\r", text), 1):
        line = raw.strip(" \t\f\x1a\ufeff")
        if not line or line.startswith(";"):
            continue
        place = Location(file, number)
        if not line.startswith(":"):
            raise InputError("hex-syntax", _not_hex(line, bool(records or base or ended)), place, HEX_HINT)
        if ended:
            raise InputError("hex-syntax", "a record after the end-of-file record", place)
        count += 1
        if count > MAX_RECORDS:
            raise InputError(
                "file-too-large",
                f"the file has more than {MAX_RECORDS} records",
                place,
                "the chip has 1024 words",
            )
        defect = _defect(line)
        if defect:
            raise InputError("hex-syntax", defect, place)
        memory = IntelHex()
        kind = line[7:9]
        try:
            memory.loadhex(io.StringIO(base + line + "\n"))
        except IntelHexError as error:
            raise InputError("hex-syntax", f"not an Intel HEX record: {error}", place) from error
        if kind == _DATA:
            records.append(_Record(number, memory))
        elif kind == _END:
            ended = True
        elif kind in _BASES:
            base = line + "\n"
    if not ended:
        raise InputError(
            "hex-syntax", "the file is truncated: it has no end-of-file record", Location(file), HEX_HINT
        )
    return records


HEX_HINT = "an Intel HEX file has lines that begin with ':' and ends with :00000001FF"


def _not_hex(line: str, begun: bool) -> str:
    """Return the message for a line without a colon."""
    if any(not char.isprintable() for char in line):
        return "this is a binary file, not an Intel HEX file"
    shown = line if len(line) <= 20 else line[:20] + "…"
    return (
        f"'{shown}' is not an Intel HEX record"
        if begun
        else f"this is not an Intel HEX file: it has '{shown}'"
    )


def _defect(line: str) -> str | None:
    """Return one sentence that describes the error in a record; None if it has none."""
    for column, char in enumerate(line[1:], 2):
        if char not in string.hexdigits:
            return f"'{char}' in column {column} is not a hexadecimal digit"
    if len(line) % 2 == 0:
        return "the record is cut within a byte: it has an odd number of digits"
    data = bytes.fromhex(line[1:])
    if len(data) < 5 or len(data) < data[0] + 5:
        return f"the record is truncated: it announces {data[0] if data else 0} data bytes and has fewer"
    if len(data) > data[0] + 5:
        return f"the record is too long: it announces {data[0]} data bytes and has {len(data) - 5}"
    if sum(data) & 0xFF:
        return f"wrong checksum 0x{data[-1]:02X}: the record's bytes give 0x{-sum(data[:-1]) & 0xFF:02X}"
    if data[3] > 5:
        return f"record type {data[3]:02X} is unknown: known are 00 to 05"
    return None


def _words(records: list[_Record], file: str | None) -> dict[int, _Halves]:
    words: dict[int, _Halves] = {}
    for record in records:
        for byte in record.memory.addresses():
            halves = words.setdefault(byte // 2, _Halves())
            half = "high" if byte % 2 else "low"
            if getattr(halves, half) is not None:
                raise InputError(
                    "hex-syntax", f"word 0x{byte // 2:04X} is given twice", Location(file, record.line)
                )
            setattr(halves, half, record.memory[byte])
            halves.line = record.line
    return words


def region_of(address: int) -> Region | None:
    """Return the memory region of the chip that contains a word address; None if there is none."""
    for region in REGIONS:
        if region.start <= address < region.start + region.length:
            return region
    return None


def image_of(words: Mapping[int, int]) -> Image:
    """Return the image of words by address; those outside all regions are omitted."""
    contents: dict[str, dict[int, int]] = {region.name: {} for region in REGIONS}
    for address, word in words.items():
        region = region_of(address)
        if region is not None:
            contents[region.name][address - region.start] = word
    return Image(contents["program"], contents["config"].get(0), contents["eeprom"], contents["ids"])


def _region(address: int, place: Location) -> Region:
    region = region_of(address)
    if region is not None:
        return region
    raise InputError(
        "hex-syntax",
        f"word address 0x{address:04X} is beyond the chip",
        place,
        hint="allowed: " + ", ".join(f"{region.name} {region.span}" for region in REGIONS),
    )
