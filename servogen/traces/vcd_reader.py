"""VCD → edges: of this program's files and of those written by GTKWave, sigrok and other tools.

In: a file, the clock of the resulting cycles and, if wires are not named after their pins, the pin of each
wire. pyvcd reads the declarations; the changes, of which there can be millions, are read block by block. High
impedance and unknown are undriven; weak high and low (H, L) are high and low.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import NoReturn

import numpy as np
from vcd.reader import TokenKind, VarDecl, VCDParseError, tokenize

from servogen.edges import HIGH, LOW, UNDRIVEN, Changes, EdgeChunk, EdgeTrace, edge_chunk
from servogen.errors import InputError, Location
from servogen.inputs import open_input, size_text
from servogen.traces import rows
from servogen.traces.endings import ended
from servogen.traces.lines import TAIL_BYTES, last_line, line_blocks
from servogen.traces.wires import pins_of
from servogen.units import Clock, Cycles

LEVEL_OF = {
    **dict.fromkeys("0lL", LOW),
    **dict.fromkeys("1hH", HIGH),
    **dict.fromkeys("zZxXuUwW-", UNDRIVEN),
}
UNIT_POWER = {"s": 0, "ms": 3, "us": 6, "ns": 9, "ps": 12, "fs": 15, "as": 18, "zs": 21}
MOST_DIGITS = 18
"""So many decimal digits always fit a signed 64-bit integer."""
MOST_CYCLES = 10**17
MAX_HEADER_BYTES = 1 << 22
"""Of the declarations: 100 000 wires."""

MAX_TAIL_BYTES = 1 << 20
"""In how much of a file's end its last time stamps are looked for."""

# sigrok-cli puts a line "META samplerate: …" in front of what it writes.
_FIRST_KEYWORD = re.compile(rb"^\s*\$", re.MULTILINE)
_END_OF_HEADER = re.compile(rb"\$enddefinitions\s+\$end\b")
_TIME = re.compile(rb"^#(\d+)", re.MULTILINE)
_KEYWORDS = frozenset((b"$dumpvars", b"$dumpall", b"$dumpon", b"$dumpoff", b"$end"))


@dataclass(frozen=True, slots=True)
class VcdHeader:
    """The declarations of a file: the seconds per time step and the pin of each identifier; and where the
    changes begin.
    """

    step_s: Fraction
    pins: Mapping[str, int]
    offset: int
    line: int
    comments: tuple[str, ...]


def read_vcd(
    path: str | Path, clock: Clock, end: int | None = None, wires: Mapping[str, str] | None = None
) -> EdgeTrace:
    """Return the edges of a VCD file in cycles of `clock`, each rounded to the nearest; the trace ends at the
    last time stamp.

    `wires` maps wires with other names to pins, as in {"D0": "RB0"}; then only these are read.
    """
    path = Path(path)
    header = read_header(path, wires)
    source = _VcdChunks(path, header, header.step_s * clock.cycles_per_second)
    known = _end(path, header.offset, source.cycles_per_step)
    return ended(clock, source, known, end)


def read_header(path: Path, wires: Mapping[str, str] | None = None) -> VcdHeader:
    """Return the declarations of the file at `path`."""
    place = Location(str(path))
    with open_input(path) as file:
        text = file.read(1 << 16)
        if not (end := _END_OF_HEADER.search(text)):
            text += file.read(MAX_HEADER_BYTES - len(text))
            end = _END_OF_HEADER.search(text)
    if end is None:
        within = f" in its first {size_text(MAX_HEADER_BYTES)}" if len(text) == MAX_HEADER_BYTES else ""
        raise InputError("vcd-syntax", f"is not a VCD file: it has no $enddefinitions{within}", place)
    first = _FIRST_KEYWORD.search(text)
    before = first.start() if first else 0
    step: Fraction | None = None
    declared: list[VarDecl] = []
    comments: list[str] = []
    try:
        for token in tokenize(io.BytesIO(text[before : end.end()] + b"\n")):
            if token.kind is TokenKind.TIMESCALE:
                step = Fraction(token.timescale.magnitude, 10 ** UNIT_POWER[token.timescale.unit.value])
            elif token.kind is TokenKind.VAR:
                declared.append(token.var)
            elif token.kind in (TokenKind.COMMENT, TokenKind.VERSION):
                comments.append(str(token.data).strip())
    except VCDParseError as error:
        message = str(error).partition(": ")[2]
        raise InputError(
            "vcd-syntax",
            f"is not a VCD file: {message}",
            Location(str(path), text.count(b"\n", 0, before) + error.loc.line),
        ) from error
    except UnicodeDecodeError as error:
        raise InputError("vcd-syntax", "is not a VCD file: its declarations are not ASCII", place) from error
    except ValueError as error:
        message = "is not a VCD file: a number in its declarations is too long"
        raise InputError("vcd-syntax", message, place, "wires have at most a few thousand bits") from error
    if not step:
        raise InputError(
            "vcd-syntax",
            "has no $timescale, or one of 0",
            place,
            "it must say how long one time step is, as `$timescale 1 us $end`",
        )
    one_bit = [(var.ref_str, var.id_code) for var in declared if var.size == 1]
    line = 1 + text.count(b"\n", 0, end.end())
    return VcdHeader(step, pins_of(one_bit, wires, place), end.end(), line, tuple(comments))


def _end(path: Path, start: int, cycles_per_step: Fraction) -> Cycles:
    """Return the cycle of the last time stamp, or the one after it if changes follow it; the end is after
    every change.
    """
    last = np.array(_last_times(path, start), dtype=np.int64)
    if int(last[-1]) * cycles_per_step > MOST_CYCLES:
        raise InputError(
            "time-order",
            f"time #{last[-1]} is too late",
            Location(str(path)),
            f"below 10^17 instruction cycles; a step of this file is {float(cycles_per_step):g}",
        )
    *before, cycle = rows.rescale(last, cycles_per_step).tolist()
    if not _TIME.fullmatch(last_line(path)):
        return Cycles(cycle + 1)
    return Cycles(max(cycle, *(time + 1 for time in before)) if before else cycle)


def _last_times(path: Path, start: int) -> list[int]:
    """Return the last two time stamps, or the only one, found from the end of the file."""
    place = Location(str(path))
    with open_input(path) as file:
        size = file.seek(0, 2)
        wanted = TAIL_BYTES
        while True:
            at = max(start, size - wanted)
            file.seek(at)
            tail = file.read()
            times = _TIME.findall(tail if at == start else tail.partition(b"\n")[2])[-2:]
            if len(times) == 2 or (times and at == start):
                late = next((time for time in times if len(time) > MOST_DIGITS), None)
                if late:
                    raise InputError(
                        "time-order", f"time #{late.decode()} is too late", place, "below 10^18 steps"
                    )
                return [int(time) for time in times]
            if at == start:
                raise InputError(
                    "vcd-syntax", "is not a whole VCD file: no time stamp follows the declarations", place
                )
            if wanted > MAX_TAIL_BYTES:
                raise InputError("vcd-syntax", f"has no time stamp in its last {size_text(wanted)}", place)
            wanted *= 8


@dataclass(frozen=True, slots=True)
class _VcdChunks:
    path: Path
    header: VcdHeader
    cycles_per_step: Fraction

    def __iter__(self) -> Iterator[EdgeChunk]:
        parser = _Parser(self.header.pins)
        changes = Changes()
        for line, block in line_blocks(self.path, self.header.offset, self.header.line):
            time, pin, level = parser.parse(block, self.path, line)
            if time:
                ticks = np.array(time, dtype=np.int64)
                chunk = changes(edge_chunk(rows.rescale(ticks, self.cycles_per_step), pin, level))
                if len(chunk.cycle):
                    yield chunk


@dataclass(slots=True)
class _Parser:
    """Reads changes token by token; an incomplete one at the end of a block continues in the next."""

    pins: Mapping[str, int]
    time: int = 0
    skipping: bool = False
    vector: bytes | None = None
    wanted: dict[bytes, tuple[int, int]] = field(init=False)

    def __post_init__(self) -> None:
        self.wanted = {
            f"{state}{code}".encode(): (pin, level)
            for code, pin in self.pins.items()
            for state, level in LEVEL_OF.items()
        }

    def parse(self, block: bytes, path: Path, line: int) -> tuple[list[int], list[int], list[int]]:
        """Return (time steps, pins, levels) of the changes in `block`."""
        times: list[int] = []
        pins: list[int] = []
        levels: list[int] = []
        wanted = self.wanted
        time = self.time
        for index, token in enumerate(block.split()):
            change = wanted.get(token)
            if change is not None and self.vector is None and not self.skipping:
                times.append(time)
                pins.append(change[0])
                levels.append(change[1])
            elif token[0] == 35 and self.vector is None and not self.skipping:  # "#": a time stamp
                digits = token[1:].removesuffix(b".0")
                if not digits.isdigit() or len(digits) > MOST_DIGITS or int(digits) < time:
                    self._complain(block, index, path, line, time)
                time = int(digits)
            elif not self._other(token, time, times, pins, levels):
                self._complain(block, index, path, line, time)
        self.time = time
        return times, pins, levels

    def _other(self, token: bytes, time: int, times: list[int], pins: list[int], levels: list[int]) -> bool:
        """Handle a token that is neither a wanted change nor a time; return False if VCD has no such
        token.
        """
        if self.skipping:
            self.skipping = token != b"$end"
        elif self.vector is not None:
            pin = self.pins.get(token.decode("ascii", "replace"))
            if pin is not None:
                times.append(time)
                pins.append(pin)
                levels.append(LEVEL_OF.get(chr(self.vector[-1]), UNDRIVEN))
            self.vector = None
        elif token[0] in b"bBrRsS":
            self.vector = token
        elif token == b"$comment":
            self.skipping = True
        else:
            return token in _KEYWORDS or (chr(token[0]) in LEVEL_OF and len(token) > 1)
        return True

    def _complain(self, block: bytes, index: int, path: Path, line: int, time: int) -> NoReturn:
        found = next(token for number, token in enumerate(re.finditer(rb"\S+", block)) if number == index)
        place = Location(str(path), line + block.count(b"\n", 0, found.start()))
        token = found.group()[:40].decode("ascii", "replace")
        if token.startswith("#"):
            raise InputError(
                "time-order",
                f"time '{token}' is not allowed here",
                place,
                f"a whole number of steps, not before #{time}",
            )
        raise InputError("vcd-syntax", f"'{token}' is not a value change of a VCD file", place)
