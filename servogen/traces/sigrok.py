"""sigrok's session files (.sr) → edges, one time step per sample.

A session is a ZIP archive: `metadata` (INI: samplerate, unitsize, probe1 … by name) and the samples of all
probes in `logic-1`, or in `logic-1-1`, `logic-1-2` … one after the other; probe n is bit n - 1 of a sample of
`unitsize` bytes, the lowest byte first. The number of samples is not stated: if the last pieces are missing,
the session is a shorter one. Source: sigrok's wiki, "File format:sigrok/v2".
"""

from __future__ import annotations

import configparser
import re
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from servogen.edges import EdgeChunk, EdgeTrace, edge_chunk
from servogen.errors import InputError, Location
from servogen.inputs import open_input, size_text
from servogen.traces.channels import assign_pins, parse_rate, step_clock
from servogen.units import Cycles, counted

MAX_UNIT_BYTES = 8
"""The maximum bytes of a sample: 64 probes."""

BLOCK_SAMPLES = 1 << 20
MAX_METADATA_BYTES = 1 << 16
"""The maximum size of the metadata; a session of 64 probes has three thousand bytes."""

MAX_MEMBERS = 10_000
"""The maximum number of files in the archive: sigrok splits its samples into pieces of some megabytes."""

MAX_SAMPLE_BYTES = 1 << 31
"""The maximum of all samples, unpacked: 35 minutes of 8 probes at 1 MHz. A packed megabyte can unpack to
1000.
"""

_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    KeyError,
    ValueError,
    OSError,
    EOFError,
    RuntimeError,
)
"""The exceptions that reading a damaged session raises."""


@dataclass(frozen=True, slots=True)
class _Session:
    """The location of the samples, the bytes per sample, and the pin of each bit."""

    path: Path
    pieces: tuple[str, ...]
    size: int
    pins: Mapping[int, int]

    def __iter__(self) -> Iterator[EdgeChunk]:
        time, last = 0, None
        for block in self._blocks():
            before = block[:1] if last is None else last
            changed = np.concatenate((before, block[:-1])) ^ block
            if last is None:
                yield self._initial(int(block[0]))
            rows = np.flatnonzero(changed & np.uint64(self._mask()))
            if len(rows):
                yield self._edges(rows + time, changed[rows], block[rows])
            time += len(block)
            last = block[-1:]

    def _mask(self) -> int:
        return sum(1 << bit for bit in self.pins)

    def _initial(self, sample: int) -> EdgeChunk:
        levels = sorted((pin, sample >> bit & 1) for bit, pin in self.pins.items())
        return edge_chunk([0] * len(levels), [pin for pin, _ in levels], [level for _, level in levels])

    def _edges(
        self, time: npt.NDArray[np.intp], changed: npt.NDArray[np.uint64], sample: npt.NDArray[np.uint64]
    ) -> EdgeChunk:
        parts = []
        for bit, pin in self.pins.items():
            own = np.flatnonzero(changed >> np.uint64(bit) & np.uint64(1))
            parts.append((time[own], np.full(len(own), pin), sample[own] >> np.uint64(bit) & np.uint64(1)))
        cycle, pins, level = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.lexsort((pins, cycle))
        return edge_chunk(cycle[order], pins[order], level[order])

    def _blocks(self) -> Iterator[npt.NDArray[np.uint64]]:
        """Yield the samples as integers."""
        try:
            yield from self._unpack()
        except _DAMAGED as error:
            raise InputError("sigrok-syntax", f"is damaged: {error}", Location(str(self.path))) from error

    def _unpack(self) -> Iterator[npt.NDArray[np.uint64]]:
        with zipfile.ZipFile(self.path) as archive:
            for piece in self.pieces:
                with archive.open(piece) as file:
                    while data := file.read(BLOCK_SAMPLES * self.size):
                        yield self._samples(data)

    def _samples(self, data: bytes) -> npt.NDArray[np.uint64]:
        wide = np.zeros((len(data) // self.size, MAX_UNIT_BYTES), dtype=np.uint8)
        wide[:, : self.size] = np.frombuffer(data, dtype=np.uint8).reshape(-1, self.size)
        return wide.view("<u8")[:, 0].astype(np.uint64)


def read_session(path: Path, wires: Mapping[str, str] | None = None) -> EdgeTrace:
    """Return the edges of a session's logic probes, in samples, up to the last sample.

    Raises InputError for a file that is not a session; damaged samples raise it when they are read.
    """
    place = Location(str(path))
    try:
        _check_directory(path)
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            members = {info.filename: info for info in entries}
            with archive.open("metadata") as file:
                metadata = file.read(MAX_METADATA_BYTES + 1).decode("utf-8")
    except _DAMAGED as error:
        raise InputError(
            "sigrok-syntax", "is not a sigrok session", place, "a ZIP archive with a file `metadata`"
        ) from error
    if len(metadata) > MAX_METADATA_BYTES:
        raise InputError(
            "file-too-large", f"has more than {size_text(MAX_METADATA_BYTES)} of metadata", place
        )
    device = _device(metadata, place)
    stated = device.get("samplerate")
    if stated is None:
        raise InputError(
            "sigrok-syntax", "does not contain its samplerate", place, "capture with a samplerate set"
        )
    rate = parse_rate(stated, place)
    unit = str(device.get("unitsize"))
    if not re.fullmatch(f"[1-{MAX_UNIT_BYTES}]", unit):
        raise InputError(
            "sigrok-syntax", f"unitsize '{unit[:40]}' is not allowed", place, f"1 to {MAX_UNIT_BYTES} bytes"
        )
    size = int(unit)
    if len(members) < len(entries):
        twice = next(name for name, count in Counter(info.filename for info in entries).items() if count > 1)
        raise InputError("sigrok-syntax", f"holds two files '{twice}'", place)
    pieces = _pieces(device.get("capturefile", "logic-1"), members, place)
    packed = next((piece for piece in pieces if members[piece].compress_type not in _COMPRESSIONS), None)
    if packed is not None:
        raise InputError(
            "sigrok-syntax",
            f"packs '{packed}' in a way that sigrok does not use",
            place,
            "stored or deflated",
        )
    cut = next((piece for piece in pieces if members[piece].file_size % size), None)
    if cut is not None:
        raise InputError(
            "sigrok-syntax",
            f"is damaged: '{cut}' ends within a sample",
            place,
            f"a whole number of samples of {counted(size, 'byte')}",
        )
    unpacked = sum(members[piece].file_size for piece in pieces)
    if unpacked > MAX_SAMPLE_BYTES:
        raise InputError(
            "file-too-large",
            f"unpacks to {size_text(unpacked)} of samples, more than {size_text(MAX_SAMPLE_BYTES)}",
            place,
            "capture for a shorter time, at a lower rate, or fewer probes",
        )
    samples = unpacked // size
    if not samples:
        raise InputError("sigrok-syntax", "holds no samples of logic probes", place)
    pins = assign_pins(_probes(device, size), wires, place)
    return EdgeTrace(step_clock(Fraction(rate), place), _Session(path, pieces, size, pins), Cycles(samples))


def _device(metadata: str, place: Location) -> Mapping[str, str]:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(metadata)
    except configparser.Error as error:
        raise InputError("sigrok-syntax", f"has metadata that cannot be read: {error}", place) from error
    for section in parser.sections():
        if section.startswith("device"):
            return parser[section]
    raise InputError("sigrok-syntax", "has no device in its metadata", place)


def _probes(device: Mapping[str, str], size: int) -> list[tuple[str, int]]:
    """Return (name, bit) of each probe in a sample of `size` bytes."""
    numbered = ((name, re.fullmatch(r"probe([1-9][0-9]?)", key)) for key, name in device.items())
    probes = [(name, int(match.group(1)) - 1) for name, match in numbered if match]
    return [(name, bit) for name, bit in probes if bit < 8 * size]


def _pieces(name: str, members: Collection[str], place: Location) -> tuple[str, ...]:
    """Return the names of the archive's sample files, in order. Raises InputError if one is missing."""
    found = (re.fullmatch(re.escape(name) + r"-([1-9][0-9]{0,8})", file) for file in members)
    numbers = sorted(int(match.group(1)) for match in found if match)
    if not numbers:
        return (name,) if name in members else ()
    if name in members:
        message = f"holds samples both in '{name}' and in '{name}-{numbers[0]}'"
        raise InputError("sigrok-syntax", message, place, "one file, or pieces numbered from 1")
    missing = next((number for number, found in enumerate(numbers, 1) if number != found), None)
    if missing is not None:
        message = f"is not complete: '{name}-{missing}' is missing before '{name}-{numbers[missing - 1]}'"
        raise InputError("sigrok-syntax", message, place, "the time of what follows is not known")
    return tuple(f"{name}-{number}" for number in numbers)


_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_END = struct.Struct("<4s4H2LH")
"""A ZIP archive's last record: signature, disk numbers, files here and in all, bytes of the directory and
where it begins, bytes of the comment. Source: PKWARE's APPNOTE, section 4.3.16."""

_END_SIGNATURE = b"PK\5\6"
_ZIP64_SIGNATURE = b"PK\6\7"
_ZIP64_LOCATOR_BYTES = 20
_MAX_COMMENT_BYTES = (1 << 16) - 1
_MAX_DIRECTORY_BYTES = 1 << 22


def _check_directory(path: Path) -> None:
    """Reject an archive whose directory would fill the memory, because zipfile reads it completely.

    Raises InputError, and ValueError for a file that is not an archive.
    """
    with open_input(path) as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - _ZIP64_LOCATOR_BYTES - _END.size - _MAX_COMMENT_BYTES))
        tail = file.read()
    signature = tail.rfind(_END_SIGNATURE)
    if signature < 0 or len(tail) - signature < _END.size:
        raise ValueError("no end of the central directory")
    _, _, _, _, count, directory_bytes, _, _ = _END.unpack_from(tail, signature)
    is_64 = tail[max(0, signature - _ZIP64_LOCATOR_BYTES) : signature].startswith(_ZIP64_SIGNATURE)
    if is_64 or count > MAX_MEMBERS or directory_bytes > _MAX_DIRECTORY_BYTES:
        raise InputError(
            "file-too-large", "is an archive of too many or too large files", Location(str(path)), _SMALL
        )


_SMALL = f"at most {MAX_MEMBERS} files, none of 4 GiB"
