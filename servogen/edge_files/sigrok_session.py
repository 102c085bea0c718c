"""sigrok's session files (.sr) → edges, one sample one time step.

A session is a ZIP archive: `metadata` (INI: samplerate, unitsize, probe1 … by name) and the samples of all
probes in `logic-1`, or in `logic-1-1`, `logic-1-2` … one after the other; probe n is bit n - 1 of a sample of
`unitsize` bytes, the lowest byte first. Source: sigrok's wiki, "File format:sigrok/v2".
"""

from __future__ import annotations

import configparser
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from servogen.edge_files.lines import open_input
from servogen.edge_files.rates import rate_in, step_clock
from servogen.edge_files.wires import pins_of
from servogen.edges import EdgeChunk, EdgeTrace, edge_chunk
from servogen.errors import InputError, Place
from servogen.units import Cycles

MOST_BYTES = 8
"""Of a sample: 64 probes."""

BLOCK_SAMPLES = 1 << 20

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
"""What zipfile raises on archives that are damaged, encrypted or packed in a way that it does not know."""


@dataclass(frozen=True, slots=True)
class _Session:
    """Where the samples are, how many bytes each has, and which bit is which pin."""

    path: Path
    members: tuple[str, ...]
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
        """The samples as integers."""
        try:
            yield from self._unpacked()
        except _DAMAGED as error:
            raise InputError(f"is damaged: {error}", Place(str(self.path))) from error

    def _unpacked(self) -> Iterator[npt.NDArray[np.uint64]]:
        with zipfile.ZipFile(self.path) as archive:
            rest = b""
            for member in self.members:
                with archive.open(member) as file:
                    while data := file.read(BLOCK_SAMPLES * self.size):
                        data = rest + data
                        whole = len(data) // self.size * self.size
                        rest = data[whole:]
                        if whole:
                            yield self._samples(data[:whole])

    def _samples(self, data: bytes) -> npt.NDArray[np.uint64]:
        wide = np.zeros((len(data) // self.size, MOST_BYTES), dtype=np.uint8)
        wide[:, : self.size] = np.frombuffer(data, dtype=np.uint8).reshape(-1, self.size)
        return wide.view("<u8")[:, 0].astype(np.uint64)


def read_session(path: Path, wires: Mapping[str, str] | None = None) -> EdgeTrace:
    """The edges of a session's logic probes; the trace ends behind the last sample."""
    place = Place(str(path))
    with open_input(path):
        pass
    try:
        with zipfile.ZipFile(path) as archive:
            metadata = archive.read("metadata").decode("utf-8")
            sizes = {info.filename: info.file_size for info in archive.infolist()}
    except _DAMAGED as error:
        raise InputError("is not a sigrok session", place, "a ZIP archive with a file `metadata`") from error
    device = _device(metadata, place)
    rate = rate_in(device.get("samplerate", ""))
    if not rate:
        raise InputError("does not say its samplerate", place, "capture with a samplerate set")
    size = int(device.get("unitsize", "0")) if device.get("unitsize", "0").isdigit() else 0
    if not 1 <= size <= MOST_BYTES:
        raise InputError(
            f"unitsize '{device.get('unitsize')}' is not allowed", place, f"1 to {MOST_BYTES} bytes"
        )
    members = _members(device.get("capturefile", "logic-1"), sizes)
    samples = sum(sizes[member] for member in members) // size
    if not samples:
        raise InputError("holds no samples of logic probes", place)
    pins = pins_of(_probes(device, size), wires, place)
    return EdgeTrace(step_clock(rate, place), _Session(path, members, size, pins), Cycles(samples))


def _device(metadata: str, place: Place) -> Mapping[str, str]:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(metadata)
    except configparser.Error as error:
        raise InputError(f"has metadata that cannot be read: {error}", place) from error
    for section in parser.sections():
        if section.startswith("device"):
            return parser[section]
    raise InputError("has no device in its metadata", place)


def _probes(device: Mapping[str, str], size: int) -> list[tuple[str, int]]:
    """(name, bit) of each probe that a sample of `size` bytes has."""
    numbered = ((name, re.fullmatch(r"probe([1-9]\d?)", key)) for key, name in device.items())
    probes = [(name, int(found.group(1)) - 1) for name, found in numbered if found]
    return [(name, bit) for name, bit in probes if bit < 8 * size]


def _members(name: str, sizes: Mapping[str, int]) -> tuple[str, ...]:
    """The archive's files of samples, in order."""
    parts = [file for file in sizes if re.fullmatch(re.escape(name) + r"-\d+", file)]
    parts.sort(key=lambda file: int(file.rpartition("-")[2]))
    return tuple(parts) or ((name,) if name in sizes else ())
