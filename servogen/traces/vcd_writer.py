"""Edges → VCD: one 1-bit wire per pin, named after pin and servo (`RB0_arm`), undriven z.

pyvcd writes the declarations and the initial values ($dumpvars); the changes, of which there can be millions,
are written block by block in the same format. There is no date, so that the same edges give the same bytes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import IO

import numpy as np
from vcd import VCDWriter
from vcd.writer import Variable

from servogen.edges import PINS, Changes, EdgeChunk
from servogen.traces import rows
from servogen.traces.inputs import INPUT_PINS, NO_INPUTS, InputRows, Inputs, Rows, merged
from servogen.units import Clock, Cycles

SCOPE = "chip"
MADE, CAPTURED = "servogen", "servogen capture"
"""What $version says of edges in cycles of a chip, and of those in samples of an analyser."""

PARTIAL = "not a whole capture: "
"""What a comment begins with in a capture that was cut short; the reason follows."""

STITCHED = "several captures, the time between them not known, of samples: "
"""In the comment of several captures in one file; begin and end of each follow, as 0-5000 6000-9000."""

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
            for pin in PINS
        ]
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
            self._add(inputs, (chunk.cycle, chunk.pin.astype(np.int64) * len(STATES) + chunk.level))

    def _add(self, inputs: Rows, edges: Rows) -> None:
        first = len(PINS) * len(STATES)
        cycles, numbers = merged((inputs[0], inputs[1] + first), edges) if len(inputs[0]) else edges
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
