"""`Image`: what is on the chip (program, configuration word, data EEPROM, ID words), from and to Intel HEX.

In: a HEX file as programmers use it, INHX8M: each word is two bytes, low byte first, at twice its address
(DS30262, section 3; EEPROM bytes stand in words from 0x2100). Out: an `Image`, or one clear error.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from intelhex import IntelHex, IntelHexError

from servogen.errors import InputError, Place
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
    """The contents of one chip. `program` and `eeprom` go by address from 0, `ids` by number 0 to 3."""

    program: Words
    config: int | None = None
    eeprom: Words = field(default_factory=dict)
    ids: Words = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("program", "eeprom", "ids"):
            object.__setattr__(self, name, _frozen(getattr(self, name)))

    @property
    def words(self) -> int:
        """How many program words are used."""
        return len(self.program)

    def flash(self) -> list[int]:
        """All program words of the chip, erased ones as the chip reads them."""
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


REGIONS = (
    Region("program", 0, PROGRAM_WORDS, WORD_MASK),
    Region("ids", ID_ADDRESS, ID_WORDS, WORD_MASK),
    Region("config", CONFIG_ADDRESS, 1, WORD_MASK),
    Region("eeprom", EEPROM_ADDRESS, EEPROM_BYTES, 0xFF),
)


def from_hex(text: str, file: str | None = None) -> Image:
    """The image in the text of an Intel HEX file. Raises InputError that names file, line and address."""
    records = _records(text, file)
    found: dict[str, dict[int, int]] = {region.name: {} for region in REGIONS}
    for address, halves in sorted(_words(records, file).items()):
        place = Place(file, halves.line)
        region = _region(address, place)
        if halves.low is None or halves.high is None:
            which = "low" if halves.low is None else "high"
            raise InputError(f"word 0x{address:04X} has no {which} byte", place)
        value = halves.low | halves.high << 8
        if value > region.largest and (region.name != "eeprom" or halves.high not in (0x34, 0x3F)):
            raise InputError(
                f"word 0x{address:04X} is 0x{value:04X}; the {region.name} area holds at most "
                f"0x{region.largest:04X}",
                place,
            )
        found[region.name][address - region.start] = value & region.largest
    return Image(found["program"], found["config"].get(0), found["eeprom"], found["ids"])


def to_hex(image: Image) -> str:
    """The Intel HEX file of an image, the same text for the same image."""
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
    """The two bytes of a word as they are found, and the line of the last."""

    low: int | None = None
    high: int | None = None
    line: int = 0


@dataclass(frozen=True, slots=True)
class _Record:
    line: int
    memory: IntelHex


_DATA_RECORD, _END_RECORD = "00", "01"


def _records(text: str, file: str | None) -> list[_Record]:
    """Each data record, read by intelhex by itself so that a defect has its line."""
    records: list[_Record] = []
    base = ""
    end = False
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.strip()
        if not line:
            continue
        place = Place(file, number)
        if end:
            raise InputError("a record after the end-of-file record", place)
        memory = IntelHex()
        kind = line[7:9]
        try:
            memory.loadhex(io.StringIO(base + line + "\n"))
        except IntelHexError as error:
            raise InputError(_defect(line, error), place) from error
        if kind == _DATA_RECORD:
            records.append(_Record(number, memory))
        elif kind == _END_RECORD:
            end = True
        else:
            base = line + "\n"
    if not end:
        raise InputError(
            "the file is truncated: it has no end-of-file record",
            Place(file),
            hint="a whole Intel HEX file ends with :00000001FF",
        )
    return records


def _defect(line: str, error: IntelHexError) -> str:
    """One sentence that says what is wrong with a record."""
    if not line.startswith(":"):
        return "not an Intel HEX record: it does not start with ':'"
    try:
        data = bytes.fromhex(line[1:])
    except ValueError:
        return "not an Intel HEX record: a character is no hexadecimal digit, or one digit is missing"
    if len(data) < 5 or len(data) != data[0] + 5:
        return f"the record is truncated or too long: it announces {data[0] if data else 0} data bytes"
    if sum(data) & 0xFF:
        right = -sum(data[:-1]) & 0xFF
        return f"wrong checksum 0x{data[-1]:02X}: the record's bytes give 0x{right:02X}"
    return f"not an Intel HEX record: {error}"


def _words(records: list[_Record], file: str | None) -> dict[int, _Halves]:
    words: dict[int, _Halves] = {}
    for record in records:
        for byte in record.memory.addresses():
            halves = words.setdefault(byte // 2, _Halves())
            half = "high" if byte % 2 else "low"
            if getattr(halves, half) is not None:
                raise InputError(f"word 0x{byte // 2:04X} is given twice", Place(file, record.line))
            setattr(halves, half, record.memory[byte])
            halves.line = record.line
    return words


def _region(address: int, place: Place) -> Region:
    for region in REGIONS:
        if region.start <= address < region.start + region.length:
            return region
    raise InputError(
        f"word address 0x{address:04X} is beyond the chip",
        place,
        hint="allowed: "
        + ", ".join(
            f"{each.name} 0x{each.start:04X}-0x{each.start + each.length - 1:04X}" for each in REGIONS
        ),
    )
