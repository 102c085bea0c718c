"""Saleae's digital CSV → edges in nanoseconds from the file's first row.

Header `Time [s],Channel 0,…` (the first versions: `Time[s], Channel 0, …`), one row for each time at which a
channel changes: seconds, and the level of every channel: 0, 1 or X (not known), which is an error for a pin.
The first row holds the initial levels. Source: Saleae's support pages, "Binary and CSV Export Formats".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import NoReturn

import numpy as np

from servogen.edges import HIGH, LOW, PINS, Changes, EdgeChunk, EdgeTrace, edge_chunk
from servogen.errors import InputError, Location
from servogen.inputs import number_in
from servogen.traces.channels import assign_pins, step_clock
from servogen.traces.lines import first_lines, last_line, line_blocks
from servogen.units import Cycles

NANOSECONDS = 10**9
LEVELS = {b"0": LOW, b"1": HIGH}
UNKNOWN = (b"X", b"x")
MAX_SECONDS = 9e9
"""The longest time: more nanoseconds do not fit a 64-bit integer."""


_OF_NUMBERS = b"0123456789+-.eE \t\r"


@dataclass(frozen=True, slots=True)
class _Rows:
    path: Path
    columns: int
    pins: Mapping[int, int]
    start: int

    def __iter__(self) -> Iterator[EdgeChunk]:
        last = 0
        changes = Changes()
        order = sorted(self.pins, key=lambda column: self.pins[column])
        pins = np.array([self.pins[column] for column in order], dtype=np.uint8)
        for number, block in line_blocks(self.path):
            lines = block.split(b"\n")[:-1]
            first = number == 1
            table = [line.split(b",") for line in lines[first:]]
            try:
                times = [row[0] for row in table]
                time = np.array(times, dtype=np.float64)
                level = [LEVELS[row[column].strip()] for row in table for column in order]
                whole = all(len(row) == self.columns for row in table)
                whole = whole and bool(np.all(np.abs(time) < MAX_SECONDS))
                whole = whole and not b"".join(times).translate(None, _OF_NUMBERS)
            except (ValueError, KeyError, IndexError):
                whole = False
            if not whole:
                _complain(lines[first:], number + first, self.path, self.columns, self.pins)
            cycle = np.rint(time * NANOSECONDS).astype(np.int64) - self.start
            if np.any(np.diff(cycle, prepend=last) < 0):
                row = int(np.argmax(np.diff(cycle, prepend=last) < 0))
                place = Location(str(self.path), number + first + row)
                raise InputError("time-order", "a time is before that of the row above", place)
            if len(cycle):
                last = int(cycle[-1])
                yield changes(edge_chunk(np.repeat(cycle, len(order)), np.tile(pins, len(cycle)), level))


def read_saleae(path: Path, wires: Mapping[str, str] | None = None) -> EdgeTrace:
    """Return the edges of the channels in nanoseconds, up to the last row: the file contains no end.

    Raises InputError for a malformed file.
    """
    place = Location(str(path), 1)
    head, first = first_lines(path, 2)
    header = head.decode("utf-8-sig", "replace").strip().split(",")
    if not header[0].replace(" ", "").lower().startswith("time[s]") or len(header) < 2:
        raise InputError(
            "csv-syntax", "is not a digital CSV file of Saleae's", place, "expected: Time [s],Channel 0,…"
        )
    names = [(name.strip(), column) for column, name in enumerate(header) if column]
    pins = assign_pins(names, wires, place)
    start, end = _nanoseconds(first, path, 2), _nanoseconds(last_line(path), path, None)
    clock = step_clock(Fraction(NANOSECONDS), place)
    return EdgeTrace(clock, _Rows(path, len(header), pins, start), Cycles(end - start + 1))


def _nanoseconds(line: bytes, path: Path, number: int | None) -> int:
    text = line.split(b",")[0].decode("utf-8", "replace").strip()
    if not _is_time(text.encode()):
        place = Location(str(path), number)
        raise InputError(
            "csv-syntax", f"time '{text[:40]}' is not a number of seconds", place, "export times in seconds"
        )
    return round(Fraction(text) * NANOSECONDS)


def _complain(lines: list[bytes], number: int, path: Path, columns: int, pins: Mapping[int, int]) -> NoReturn:
    """Raise InputError for the first malformed line."""
    for offset, line in enumerate(lines):
        place = Location(str(path), number + offset)
        time, *levels = (field.strip() for field in line.split(b","))
        if len(levels) != columns - 1:
            shown = line[:40].decode("utf-8", "replace")
            raise InputError("csv-syntax", f"'{shown}' does not have {columns} fields like the header", place)
        for column, level in enumerate(levels, 1):
            if level in UNKNOWN and column in pins:
                raise InputError(
                    "unknown-level",
                    f"the level of {PINS[pins[column]]} is not known ({level.decode()})",
                    place,
                    "record the pin for the whole time; what was not recorded shows nothing",
                )
            if level not in LEVELS and level not in UNKNOWN:
                shown = level[:40].decode("utf-8", "replace")
                raise InputError("csv-syntax", f"level '{shown}' is not allowed", place, "allowed: 0, 1, X")
        if not _is_time(time):
            shown = time[:40].decode("utf-8", "replace")
            raise InputError(
                "csv-syntax", f"time '{shown}' is not a number of seconds", place, "export times in seconds"
            )
    raise InputError("csv-syntax", "is not a digital CSV file of Saleae's", Location(str(path), number))


def _is_time(text: bytes) -> bool:
    seconds = number_in(text.decode("utf-8", "replace"))
    return seconds is not None and abs(seconds) < MAX_SECONDS
