"""Edges ↔ VCD: one 1-bit wire per pin, named after pin and servo (`RB0_arm`), undriven z.

pyvcd writes and reads the declarations and the initial values ($dumpvars); the changes, of which there can
be millions, are written and read block by block. There is no date, so that the same edges give the same
bytes.

Files written by GTKWave, sigrok and other tools are read too; where wires are not named after their pins,
the caller says which is which. High impedance is undriven; weak high and low (H, L) are high and low. A pin
whose level is unknown for any time (X; without a value at the beginning; after $dumpoff) is an error, because
a level that was not recorded shows nothing.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import IO, NoReturn

import numpy as np
from vcd import VCDWriter
from vcd.reader import TokenKind, VarDecl, VCDParseError, tokenize
from vcd.writer import Variable

from servogen.edges import (
    HIGH,
    LOW,
    PAIR_PINS,
    PIN_NAMES,
    PINS,
    UNDRIVEN,
    Changes,
    EdgeChunk,
    EdgeTrace,
    edge_chunk,
)
from servogen.errors import InputError, Location
from servogen.inputs import open_input, size_text
from servogen.traces import rows
from servogen.traces.channels import assign_pins
from servogen.traces.inputs import INPUT_PINS, NO_INPUTS, InputRows, Inputs, Rows, merge_inputs
from servogen.traces.lines import TAIL_BYTES, ended, line_blocks
from servogen.units import Clock, Cycles

SCOPE = "chip"
MADE, CAPTURED = "servogen", "servogen capture"
"""The $version of files with edges in cycles of a chip, and of those in samples of an analyser."""

PARTIAL = "not a whole capture: "
"""The beginning of the comment in an incomplete capture; the reason follows."""

STITCHED = "several captures, the time between them not known, of samples: "
"""The comment of several captures in one file; beginning and end of each follow, such as 0-5000 6000-9000."""

STATES = "01z"
"""VCD's values by level number: LOW, HIGH, UNDRIVEN."""

_PICOSECOND = Fraction(1, 10**12)
_UNITS = tuple(
    (magnitude, unit, Fraction(magnitude, 10**power))
    for power, unit in ((6, "us"), (9, "ns"), (12, "ps"))
    for magnitude in ((1,) if unit == "us" else (100, 10, 1))
)
"""(magnitude, unit, seconds) of every timescale in use, longest first."""


@dataclass(frozen=True, slots=True)
class VcdTimes:
    """The times of a VCD file: the length of a step, the steps per cycle, and the resulting error.

    `steps_per_cycle` is a whole number if a timescale divides the cycle; otherwise each edge is at the
    nearest picosecond, at most `worst_error_s` seconds off, and errors do not add up.
    """

    timescale: tuple[int, str]
    steps_per_cycle: Fraction
    worst_error_s: Fraction

    @property
    def exact(self) -> bool:
        return self.worst_error_s == 0

    def sentence(self) -> str:
        """Return the sentence for the file's comment (ASCII)."""
        magnitude, unit = self.timescale
        if self.exact:
            return f"one instruction cycle is exactly {self.steps_per_cycle * magnitude} {unit}"
        cycle = float(self.steps_per_cycle)
        error = float(self.worst_error_s / _PICOSECOND)
        return (
            f"one instruction cycle is {cycle:.6f} ps, which is not a whole number: "
            f"each edge is at the nearest ps, at most {error:.3f} ps off; the errors do not add up"
        )


def vcd_times(clock: Clock) -> VcdTimes:
    """Return the longest timescale that divides an instruction cycle; picoseconds if none does."""
    cycle = 1 / clock.cycles_per_second
    for magnitude, unit, seconds in _UNITS:
        steps = cycle / seconds
        if steps.denominator == 1:
            return VcdTimes((magnitude, unit), steps, Fraction(0))
    steps = cycle / _PICOSECOND
    # A multiple of n/d is farthest from a whole number by floor(d/2)/d.
    error = Fraction(steps.denominator // 2, steps.denominator)
    return VcdTimes((1, "ps"), steps, error * _PICOSECOND)


def wire_name(pin: str, servo: str | None) -> str:
    """Return the name of the wire of `pin`: `RB0`, or `RB0_arm`, with characters that VCD does not allow
    replaced by underscores.
    """
    return f"{pin}_{re.sub(r'[^A-Za-z0-9_]', '_', servo)}" if servo else pin


class VcdWriter:
    """Writes chunks in order to a binary file; `servos` names the pins' servos.

    `captured` marks the cycles as an analyser's samples, which the file states; `missing` is the reason why
    such a capture is incomplete, `pieces` are the beginning and end of each of several. The changes of
    `inputs` have wires of their own (`inRA4`), which no reader mistakes for a pin's.
    """

    def __init__(
        self,
        file: IO[bytes],
        clock: Clock,
        servos: Mapping[str, str] | None = None,
        captured: bool = False,
        missing: str | None = None,
        pieces: Sequence[tuple[int, int]] = (),
        inputs: Inputs = NO_INPUTS,
        pins: Mapping[int, str] = PIN_NAMES,
    ) -> None:
        self.times = vcd_times(clock)
        self._file = file
        self._changes = Changes()
        self._head = io.StringIO()
        comment = f"clock {clock.hz} Hz: {self.times.sentence()}"
        if captured:
            comment = f"captured on all channels at {float(clock.cycles_per_second):.15g} Hz"
            if pieces:
                comment += f"; {STITCHED}{' '.join(f'{begin}-{end}' for begin, end in pieces)}"
            if missing is not None:
                comment += f"; {PARTIAL}{missing}"
        # An empty date, not None: pyvcd would write today's.
        self._vcd = VCDWriter(
            self._head, self.times.timescale, date="", comment=comment, version=CAPTURED if captured else MADE
        )
        names = servos or {}
        self._wires: list[Variable[object]] = [
            self._vcd.register_var(SCOPE, wire_name(pin, names.get(pin)), "wire", size=1, init="z")
            for pin in pins.values()
        ]
        self._first = len(pins) * len(STATES)
        """The first row of an input."""
        self._wire_of = np.zeros(PAIR_PINS, dtype=np.int64)
        self._wire_of[list(pins)] = range(len(pins))
        self._wires += [
            self._vcd.register_var(SCOPE, f"in{INPUT_PINS[pin]}", "wire", size=1, init="z")
            for pin in inputs.pins
        ]
        self._inputs = InputRows(inputs)
        self._tails = rows.table([f"{state}{wire.ident}\n" for wire in self._wires for state in STATES])
        self._declaring = True
        self._time = 0

    def add(self, chunk: EdgeChunk) -> None:
        if len(chunk.cycle):
            inputs = self._inputs.until(int(chunk.cycle[-1]) + 1)
            chunk = self._changes(chunk)
            self._add(inputs, (chunk.cycle, self._wire_of[chunk.pin] * len(STATES) + chunk.level))

    def _add(self, inputs: Rows, edges: Rows) -> None:
        first = self._first
        cycles, numbers = merge_inputs((inputs[0], inputs[1] + first), edges) if len(inputs[0]) else edges
        if self._declaring:
            at_zero = int(np.searchsorted(cycles, 1))
            for number in numbers[:at_zero].tolist():
                wire, level = divmod(number, len(STATES))
                self._vcd.change(self._wires[wire], 0, STATES[level])
            cycles, numbers = cycles[at_zero:], numbers[at_zero:]
            if len(cycles):
                self._declare()
        for start in range(0, len(cycles), rows.BLOCK):
            block = slice(start, start + rows.BLOCK)
            self._add_block(cycles[block], numbers[block])

    def finish(self, end: Cycles) -> None:
        """Write the remaining changes of inputs, and the last time stamp, which is the end of the trace."""
        nothing = np.zeros(0, dtype=np.int64)
        self._add(self._inputs.until(end), (nothing, nothing))
        self._declare()
        (time,) = rows.rescale(np.array([end], dtype=np.int64), self.times.steps_per_cycle).tolist()
        if time > self._time:
            self._file.write(f"#{time}\n".encode())

    def _declare(self) -> None:
        if self._declaring:
            self._vcd.flush()
            self._file.write(self._head.getvalue().encode("ascii"))
            self._declaring = False

    def _add_block(self, cycles: rows.Integers, numbers: rows.Integers) -> None:
        time = rows.rescale(cycles, self.times.steps_per_cycle)
        digits = rows.decimals(time)
        stamps = np.concatenate(
            (
                np.full((len(time), 1), ord("#"), dtype=np.uint8),
                digits,
                np.full((len(time), 1), ord("\n"), dtype=np.uint8),
            ),
            axis=1,
        )
        stamps[np.diff(time, prepend=self._time) == 0] = 0
        self._file.write(rows.text(stamps, self._tails[numbers]))
        self._time = int(time[-1])


LEVEL_OF = {
    **dict.fromkeys("0lL", LOW),
    **dict.fromkeys("1hH", HIGH),
    **dict.fromkeys("zZ", UNDRIVEN),
}
UNKNOWN = "xXuUwW-"
UNIT_POWER = {"s": 0, "ms": 3, "us": 6, "ns": 9, "ps": 12, "fs": 15, "as": 18, "zs": 21}
MAX_DIGITS = 18
"""The number of decimal digits that always fit a signed 64-bit integer."""
MAX_CYCLES = 10**17
MAX_HEADER_BYTES = 1 << 22
"""The maximum size of the declarations: 100 000 wires."""

MAX_TAIL_BYTES = 1 << 20
"""The part of a file's end in which its last time stamps are searched."""

# sigrok-cli puts a line "META samplerate: …" in front of what it writes.
_FIRST_KEYWORD = re.compile(rb"^\s*\$", re.MULTILINE)
_END_OF_HEADER = re.compile(rb"\$enddefinitions\s+\$end\b")
_TIME = re.compile(rb"^#(\d+)", re.MULTILINE)
_ONE_BIT = re.compile(rb"[bB]0*([01zZxXhHlLuUwW-])")
"""The vector of a wire of one bit; anything else would lose what it does not read."""
_DUMPOFF = b"$dumpoff"
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
    path: str | Path,
    clock: Clock,
    end: int | None = None,
    wires: Mapping[str, str] | None = None,
    from_first: bool = False,
) -> EdgeTrace:
    """Return the edges of a VCD file in cycles of `clock`, rounded to the nearest, up to the last time stamp.

    `wires` maps wires with other names to pins, as in {"D0": "RB0"}; then only these are read. `from_first`:
    the first time stamp is cycle 0. Raises InputError for a malformed header, and for malformed changes and
    unknown levels when the edges are iterated.
    """
    path = Path(path)
    header = read_header(path, wires)
    cycles_per_step = header.step_s * clock.cycles_per_second
    begin = _first_time(path, header.offset) if from_first else 0
    times, rest = _last_times(path, header.offset)
    from_begin = [time - begin for time in times]
    off = rest.startswith(_DUMPOFF)
    known = _end(path, from_begin, cycles_per_step, is_last=not rest or off)
    source = _VcdChunks(path, header, cycles_per_step, begin, times[-1], ends_off=off)
    return ended(clock, source, known, end)


def read_header(path: Path, wires: Mapping[str, str] | None = None) -> VcdHeader:
    """Return the declarations of the VCD file at `path`. Raises InputError if they are malformed."""
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
        message = str(error).removeprefix(f"{error.loc.line}:{error.loc.column}: ")
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
            "it must state the length of a time step, such as `$timescale 1 us $end`",
        )
    one_bit = [(var.ref_str, var.id_code) for var in declared if var.size == 1]
    line = 1 + text.count(b"\n", 0, end.end())
    return VcdHeader(
        step_s=step,
        pins=assign_pins(one_bit, wires, place),
        offset=end.end(),
        line=line,
        comments=tuple(comments),
    )


def _first_time(path: Path, start: int) -> int:
    """Return the time stamp with which the changes begin; 0 if values without a time come before it."""
    with open_input(path) as file:
        file.seek(start)
        tokens = iter(file.read(TAIL_BYTES).split())
    first = next((token for token in tokens if token != b"$comment" or b"$end" not in tokens), b"")
    stamp = _TIME.fullmatch(first.removesuffix(b".0"))
    return int(stamp.group(1)[:MAX_DIGITS]) if stamp else 0


def _end(path: Path, times: Sequence[int], cycles_per_step: Fraction, is_last: bool) -> Cycles:
    """Return the cycle of the last of `times`, or the one after it if that is not `is_last`, because changes
    follow it; the end is after every change.
    """
    last = np.array(times, dtype=np.int64)
    if int(last[-1]) * cycles_per_step > MAX_CYCLES:
        raise InputError(
            "time-order",
            f"time #{last[-1]} is too late",
            Location(str(path)),
            f"below 10^17 instruction cycles; a step of this file is {float(cycles_per_step):g}",
        )
    *before, cycle = rows.rescale(last, cycles_per_step).tolist()
    if not is_last:
        return Cycles(cycle + 1)
    return Cycles(max(cycle, *(time + 1 for time in before)) if before else cycle)


def _last_times(path: Path, start: int) -> tuple[list[int], bytes]:
    """Return the last two time stamps, or the only one, and what follows the last one, found from the end of
    the file.
    """
    place = Location(str(path))
    with open_input(path) as file:
        size = file.seek(0, 2)
        wanted = TAIL_BYTES
        while True:
            offset = max(start, size - wanted)
            file.seek(offset)
            tail = file.read()
            whole = tail if offset == start else tail.partition(b"\n")[2]
            stamps = list(_TIME.finditer(whole))[-2:]
            if len(stamps) == 2 or (stamps and offset == start):
                times = [stamp.group(1) for stamp in stamps]
                late = next((time for time in times if len(time) > MAX_DIGITS), None)
                if late:
                    raise InputError(
                        "time-order", f"time #{late.decode()} is too late", place, "below 10^18 steps"
                    )
                return [int(time) for time in times], whole[stamps[-1].end() :].strip()
            if offset == start:
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
    begin: int
    """The time step that is cycle 0."""
    last: int
    """The last time stamp, as it was found from the end of the file."""
    ends_off: bool
    """Whether the recording was switched off at the last time stamp."""

    def __iter__(self) -> Iterator[EdgeChunk]:
        parser = _Parser(self.header.pins, self.begin)
        changes = Changes()
        for line, block in line_blocks(self.path, self.header.offset, self.header.line):
            time, pin, level = parser.parse(block, self.path, line)
            if time:
                ticks = np.array(time, dtype=np.int64) - self.begin
                chunk = changes(edge_chunk(rows.rescale(ticks, self.cycles_per_step), pin, level))
                if len(chunk.cycle):
                    yield chunk
        if parser.skipping or parser.vector is not None or parser.time != self.last:
            raise InputError(
                "vcd-syntax",
                f"ends within a comment or a value after #{parser.time}",
                Location(str(self.path)),
                "record it again: it may be truncated",
            )
        if parser.unknown and not self.ends_off:
            raise _unknown(parser.unknown, None, Location(str(self.path)))


@dataclass(slots=True)
class _Parser:
    """Reads changes token by token; an incomplete one at the end of a block continues in the next."""

    pins: Mapping[str, int]
    time: int
    skipping: bool = False
    vector: bytes | None = None
    wanted: dict[bytes, tuple[int, int]] = field(init=False)
    unknown: dict[int, int] = field(init=False)
    """The pins whose level is not known now, each with the time from which it is not."""

    def __post_init__(self) -> None:
        self.unknown = dict.fromkeys(self.pins.values(), self.time)
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
        wanted, unknown = self.wanted, self.unknown
        time = self.time
        for index, token in enumerate(block.split()):
            change = wanted.get(token)
            if change is not None and self.vector is None and not self.skipping:
                times.append(time)
                pins.append(change[0])
                levels.append(change[1])
                if unknown:
                    unknown.pop(change[0], None)
            elif token[0] == 35 and self.vector is None and not self.skipping:  # "#": a time stamp
                digits = token[1:].removesuffix(b".0")
                if not digits.isdigit() or len(digits) > MAX_DIGITS or int(digits) < time:
                    self._complain(block, index, path, line, time)
                if unknown and int(digits) > time:
                    raise _unknown(unknown, token, _place(block, index, path, line)[1])
                time = int(digits)
            elif not self._handle(token, time, times, pins, levels):
                self._complain(block, index, path, line, time)
        self.time = time
        return times, pins, levels

    def _handle(self, token: bytes, time: int, times: list[int], pins: list[int], levels: list[int]) -> bool:
        """Handle a token that is neither a wanted change nor a time; return False if VCD has no such
        token.
        """
        if self.skipping:
            self.skipping = token != b"$end"
        elif self.vector is not None:
            pin = self.pins.get(token.decode("ascii", "replace"))
            whole = _ONE_BIT.fullmatch(self.vector)
            self.vector = None
            if pin is None:
                return True
            if whole is None:
                return False
            value = whole[1].decode()
            if value in UNKNOWN:
                self.unknown.setdefault(pin, time)
                return True
            self.unknown.pop(pin, None)
            times.append(time)
            pins.append(pin)
            levels.append(LEVEL_OF[value])
        elif token[0] in b"bBrRsS":
            self.vector = token
        elif token == b"$comment":
            self.skipping = True
        elif token == _DUMPOFF:
            self.unknown |= {pin: time for pin in self.pins.values() if pin not in self.unknown}
        elif chr(token[0]) in UNKNOWN and len(token) > 1:
            pin = self.pins.get(token[1:].decode("ascii", "replace"))
            if pin is not None:
                self.unknown.setdefault(pin, time)
        else:
            return token in _KEYWORDS or (chr(token[0]) in LEVEL_OF and len(token) > 1)
        return True

    def _complain(self, block: bytes, index: int, path: Path, line: int, time: int) -> NoReturn:
        shown, place = _place(block, index, path, line)
        token = shown[:40].decode("ascii", "replace")
        if token.startswith("#"):
            raise InputError(
                "time-order",
                f"time '{token}' is not allowed here",
                place,
                f"a whole number of steps, not before #{time}",
            )
        raise InputError("vcd-syntax", f"'{token}' is not a value change of a VCD file", place)


def _place(block: bytes, index: int, path: Path, line: int) -> tuple[bytes, Location]:
    """Return token `index` of a block that begins at `line`, and its place."""
    token = next(islice(re.finditer(rb"\S+", block), index, None))
    return token.group(), Location(str(path), line + block.count(b"\n", 0, token.start()))


def _unknown(unknown: Mapping[int, int], until: bytes | None, place: Location) -> InputError:
    """Return the error for the pin that is `unknown` for the longest time, up to the stamp `until`."""
    since, pin = min((since, pin) for pin, since in unknown.items())
    end = "the end" if until is None else until.decode("ascii")
    return InputError(
        "unknown-level",
        f"the level of {PINS[pin]} is not known from #{since} to {end}",
        place,
        "a value at the first time stamp, no X or $dumpoff after it; what was not recorded shows nothing",
    )
