"""Edges ↔ CSV: header `cycle,pin,level`, one row per change of a pin, in order; undriven is 0.

`cycle` counts instruction cycles since reset, `pin` is RA0 … RB7, `level` 0 or 1. Levels applied to a pin
from outside have letters of their own: L, H, or Z when the pin is released; such a pin may also be MCLR.

Because cycles never decrease, lines of equal length are adjacent: a block of them is a matrix, which is read
column by column.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import IO, NoReturn

import numpy as np

from servogen.edges import PINS, Driven, EdgeChunk, EdgeTrace, edge_chunk, join
from servogen.errors import InputError, Location
from servogen.traces import rows
from servogen.traces.inputs import INPUT_PINS, NO_INPUTS, InputRows, Inputs, Rows, merge_inputs
from servogen.traces.lines import ended, last_line, line_blocks
from servogen.units import Clock, Cycles

HEADER = "cycle,pin,level"
APPLIED = "LHZ"
"""Levels that are applied to an input from outside: low, high, released."""
_INPUT = re.compile(rb"^\d{1,18},(?:RA[0-4]|RB[0-7]|MCLR),[LHZ]\n", re.MULTILINE)
MAX_DIGITS = 18
"""The number of decimal digits that always fit a signed 64-bit integer."""

_TAILS = rows.table([f",{pin},{level}\n" for pin in PINS for level in (0, 1)])
_TAIL_LENGTH = len(",RB0,1")
_NO_PIN = 255
_PIN_OF = np.full(1 << 16, _NO_PIN, dtype=np.uint8)
for _number, _name in enumerate(PINS):
    _PIN_OF[ord(_name[1]) << 8 | ord(_name[2])] = _number


class CsvWriter:
    """Writes chunks in order to a binary file, with the changes of inputs merged in."""

    def __init__(self, file: IO[bytes], inputs: Inputs = NO_INPUTS) -> None:
        self._file = file
        self._driven = Driven()
        self._inputs = InputRows(inputs)
        texts = [f",{INPUT_PINS[pin]},{letter}\n" for pin in inputs.pins for letter in APPLIED]
        self._tails = rows.joined(_TAILS, rows.table(texts)) if texts else _TAILS
        file.write(f"{HEADER}\n".encode())
        self._inputs.until(1)  # a level that is present at power-up is not a change

    def add(self, chunk: EdgeChunk) -> None:
        if not len(chunk.cycle):
            return
        last = int(chunk.cycle[-1])
        driven = self._driven(chunk)
        self._write(
            self._inputs.until(last + 1), (driven.cycle, driven.pin.astype(np.int64) * 2 + driven.level)
        )

    def finish(self, end: Cycles) -> None:
        """Write the remaining changes of inputs; the format does not store the end of the trace."""
        nothing = np.zeros(0, dtype=np.int64)
        self._write(self._inputs.until(end), (nothing, nothing))

    def _write(self, inputs: Rows, edges: Rows) -> None:
        cycles, numbers = (
            merge_inputs((inputs[0], inputs[1] + len(_TAILS)), edges) if len(inputs[0]) else edges
        )
        for start in range(0, len(cycles), rows.BLOCK):
            block = slice(start, start + rows.BLOCK)
            self._file.write(rows.text(rows.decimals(cycles[block]), self._tails[numbers[block]]))


def read_csv(path: str | Path, clock: Clock, end: int | None = None) -> EdgeTrace:
    """Return the edges of a CSV file up to cycle `end`, by default to the last edge: the file has no end.

    The file is read, and InputError raised for a malformed row, when the edges are iterated.
    """
    source = _CsvChunks(Path(path))
    last = last_line(source.path).split(b",")[0]
    known = Cycles(int(last) + 1 if last.isdigit() and len(last) <= MAX_DIGITS else 0)
    return ended(clock, source, known, end)


@dataclass(frozen=True, slots=True)
class _CsvChunks:
    path: Path

    def __iter__(self) -> Iterator[EdgeChunk]:
        last = 0
        first = True
        for line, block in line_blocks(self.path):
            if first:
                header, _, block = block.partition(b"\n")
                self._check_header(header)
                first, line = False, line + 1
            chunk = _parse(_without_inputs(block), last)
            if chunk is None:
                _complain(block, last, self.path, line)
            if len(chunk.cycle):
                last = int(chunk.cycle[-1])
                yield chunk
        if first:
            self._check_header(b"")

    def _check_header(self, header: bytes) -> None:
        if header.removeprefix(b"\xef\xbb\xbf").decode("utf-8", "replace") != HEADER:
            shown = header[:40].decode("utf-8", "replace")
            raise InputError(
                "csv-syntax",
                f"is not an edge file: its first line is '{shown}'",
                Location(str(self.path), 1),
                f"expected: {HEADER}",
            )


def _without_inputs(block: bytes) -> bytes:
    """Return the rows of the chip's own edges; levels applied to it say nothing about the program."""
    if any(f"{letter}\n".encode() in block for letter in APPLIED):
        return _INPUT.sub(b"", block)
    return block


def _parse(block: bytes, last: int) -> EdgeChunk | None:
    """Return the edges of whole lines, or None if any line is malformed or its cycle is before `last`."""
    data = np.frombuffer(block, dtype=np.uint8)
    ends = np.flatnonzero(data == ord("\n"))
    lengths = np.diff(ends, prepend=-1) - 1
    if np.any(lengths[1:] < lengths[:-1]):
        return None
    bounds = [0, *(np.flatnonzero(np.diff(lengths)) + 1), len(lengths)]
    parts = []
    position = 0
    for start, stop in pairwise(bounds):
        if start == stop:
            continue
        size = (stop - start) * (int(lengths[start]) + 1)
        part = _parse_equal(data[position : position + size].reshape(stop - start, -1))
        if part is None:
            return None
        parts.append(part)
        position += size
    chunk = join(parts)
    falls = np.any(np.diff(chunk.cycle, prepend=last) < 0)
    return None if falls else chunk


def _parse_equal(lines: rows.Bytes) -> EdgeChunk | None:
    """Return the edges of lines of equal length: shape (lines, length with the line feed)."""
    digits = lines.shape[1] - _TAIL_LENGTH - 1
    if not 1 <= digits <= MAX_DIGITS:
        return None
    cycle = np.zeros(len(lines), dtype=np.int64)
    good = np.ones(len(lines), dtype=bool)
    for column in range(digits):
        digit = lines[:, column] - ord("0")  # wraps below "0", to a large number
        good &= digit <= 9
        cycle *= 10
        cycle += digit
    if digits > 1:
        good &= lines[:, 0] != ord("0")
    comma, r, port, bit, second, level, _ = lines[:, digits:].T
    pin = _PIN_OF[port.astype(np.uint16) << 8 | bit]
    high = level - ord("0")
    good &= (comma == ord(",")) & (r == ord("R")) & (pin != _NO_PIN) & (second == ord(",")) & (high <= 1)
    return edge_chunk(cycle, pin, high) if good.all() else None


def _complain(block: bytes, last: int, path: Path, line: int) -> NoReturn:
    """Raise InputError for the first line of `block` that `_parse` rejected."""
    for number, text in enumerate(block.decode("utf-8", "replace").split("\n"), line):
        place = Location(str(path), number)
        if _INPUT.fullmatch(f"{text}\n".encode()):
            continue
        fields = text.split(",")
        if len(fields) != 3:
            raise InputError(
                "csv-syntax", f"'{text[:40]}' is not a row of an edge file", place, f"expected: {HEADER}"
            )
        cycle, pin, level = fields
        if not _is_plain(cycle):
            hint = f"instruction cycles since reset: at most {MAX_DIGITS} digits, no leading zeros"
            raise InputError("csv-syntax", f"cycle '{cycle[:40]}' is not allowed", place, hint)
        if pin not in PINS:
            raise InputError(
                "csv-syntax", f"pin '{pin[:40]}' is not allowed", place, f"allowed: {', '.join(PINS)}"
            )
        if level not in ("0", "1"):
            raise InputError(
                "csv-syntax", f"level '{level[:40]}' is not allowed", place, "allowed: 0, 1 (undriven is 0)"
            )
        if int(cycle) < last:
            raise InputError(
                "time-order",
                f"cycle {cycle} comes after cycle {last}",
                place,
                "rows must be in the order of their cycles",
            )
        last = int(cycle)
    raise InputError("csv-syntax", "is not an edge file", Location(str(path), line), f"expected: {HEADER}")


def _is_plain(text: str) -> bool:
    digits = text.isascii() and text.isdigit() and len(text) <= MAX_DIGITS
    return digits and (text == "0" or text[0] != "0")
