"""Edges ↔ JSON lines: {"cycle":1000,"pin":"RB0","level":0}, one object per change, in order; level 0, 1 or
"z".

Unlike CSV, it preserves undriven levels. Objects of other programs may have further keys and any spacing.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np

from servogen.edges import PINS, Changes, EdgeChunk, EdgeTrace, edge_chunk
from servogen.errors import InputError, Location, did_you_mean
from servogen.traces import rows
from servogen.traces.lines import ended, last_line, line_blocks
from servogen.units import Clock, Cycles

KEYS = ("cycle", "pin", "level")
LEVELS: tuple[int | str, ...] = (0, 1, "z")
"""By level number: LOW, HIGH, UNDRIVEN."""

_EXAMPLE = '{"cycle":1000,"pin":"RB0","level":1}'
_MAX_CYCLES = 10**18
_HEAD = rows.table(['{"cycle":'])
_TAILS = rows.table(
    [f',"pin":"{pin}","level":{json.dumps(level)}}}\n' for pin in PINS for level in LEVELS],
)
_PIN_NUMBER = {pin: number for number, pin in enumerate(PINS)}


class JsonlWriter:
    """Writes chunks in order to a binary file."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._changes = Changes()

    def add(self, chunk: EdgeChunk) -> None:
        for block in rows.blocks(self._changes(chunk)):
            head = np.repeat(_HEAD, len(block.cycle), axis=0)
            tails = _TAILS[block.pin.astype(np.intp) * len(LEVELS) + block.level]
            self._file.write(rows.text(head, rows.decimals(block.cycle), tails))

    def finish(self, end: Cycles) -> None:
        """Do nothing, because the format does not store the end of the trace."""


def read_jsonl(path: str | Path, clock: Clock, end: int | None = None) -> EdgeTrace:
    """Return the edges of a JSONL file up to cycle `end`, by default to the last edge: the file has no end.

    The file is read, and InputError raised for a malformed line, when the edges are iterated.
    """
    source = _JsonlChunks(Path(path))
    try:
        cycle = json.loads(last_line(source.path))["cycle"]
    except (ValueError, KeyError, TypeError, RecursionError):
        cycle = None  # the iteration names the line
    known = Cycles(cycle + 1 if _is_cycle(cycle) else 0)
    return ended(clock, source, known, end)


@dataclass(frozen=True, slots=True)
class _JsonlChunks:
    path: Path

    def __iter__(self) -> Iterator[EdgeChunk]:
        last = 0
        for line, block in line_blocks(self.path):
            chunk = _parse(block, last)
            if chunk is None:
                _complain(block, last, self.path, line)
            if len(chunk.cycle):
                last = int(chunk.cycle[-1])
                yield chunk


def _parse(block: bytes, last: int) -> EdgeChunk | None:
    """Return the edges of whole lines, or None if any line is malformed or its cycle is before `last`."""
    lines = [line for line in block.split(b"\n") if line.strip()]
    try:
        # One call of the C parser for all lines is several times faster than one call per line.
        objects: list[dict[str, Any]] = json.loads(b"[" + b",".join(lines) + b"]")
        cycle = [edge["cycle"] for edge in objects]
        pin = [_PIN_NUMBER[edge["pin"]] for edge in objects]
        level = [LEVELS.index(edge["level"]) for edge in objects]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    if len(objects) != len(lines) or not all(map(_is_cycle, cycle)):
        return None
    chunk = edge_chunk(cycle, pin, level)
    falls = np.any(np.diff(chunk.cycle, prepend=last) < 0)
    return None if falls else chunk


def _complain(block: bytes, last: int, path: Path, line: int) -> NoReturn:
    """Raise InputError for the first line of `block` that `_parse` rejected."""
    for number, row in enumerate(block.split(b"\n"), line):
        place = Location(str(path), number)
        try:
            text = row.decode("utf-8")
        except UnicodeDecodeError as error:
            raise InputError("not-utf8", "is not UTF-8 text", place) from error
        if text.strip():
            last = _check(text, last, place)
    raise InputError(
        "json-syntax", "is not one JSON object per line", Location(str(path), line), f"like {_EXAMPLE}"
    )


def _check(text: str, last: int, place: Location) -> int:
    """Return the cycle of one line. Raises InputError with the reason if the line is not valid."""
    try:
        edge = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(
            "json-syntax", f"is not JSON: {error}", place, f"expected one object per line, like {_EXAMPLE}"
        ) from error
    if not isinstance(edge, dict):
        raise InputError("json-syntax", f"'{text[:40]}' is not a JSON object", place, f"like {_EXAMPLE}")
    for key in KEYS:
        if key not in edge:
            raise InputError("json-value", f"has no '{key}'", place, f"like {_EXAMPLE}")
    cycle, pin, level = (edge[key] for key in KEYS)
    if not _is_cycle(cycle):
        raise InputError(
            "json-value",
            f"cycle {_literal(cycle)} is not allowed",
            place,
            "a whole number of instruction cycles since reset, below 10^18",
        )
    if pin not in PINS:
        raise InputError(
            "unknown-pin", f"pin {_literal(pin)} is not allowed", place, did_you_mean(str(pin), PINS)
        )
    if level not in LEVELS:
        raise InputError("json-value", f"level {_literal(level)} is not allowed", place, 'allowed: 0, 1, "z"')
    if cycle < last:
        raise InputError(
            "time-order",
            f"cycle {cycle} comes after cycle {last}",
            place,
            "edges must be in the order of their cycles",
        )
    return int(cycle)


def _literal(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}…"


def _is_cycle(value: object) -> bool:
    return type(value) is int and 0 <= value < _MAX_CYCLES
