"""What pins did, in numbers that a test compares: edges, pulse widths, periods, bytes on a serial line.

In: the edges of the pins, in one or several pieces. Out: whole instruction cycles or, from the functions
whose names end in `_us`, microseconds. Only what was seen whole counts: a pulse that the end cuts off has no
width.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import partial
from itertools import islice, pairwise, takewhile
from operator import ge
from pathlib import Path

import numpy as np
import numpy.typing as npt

from servogen.contract import judge_contract, load_contract, parse_contract
from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, join
from servogen.errors import InputError, did_you_mean
from servogen.pulses import Pulses, pulses
from servogen.simulator.sources import whole
from servogen.units import Clock

Moment = Fraction
"""A time in microseconds, exact."""
Level = tuple[Moment, int]
"""A level that a pin has from this moment on."""

MAX_BIT_ERROR = Fraction(1, 4)
"""The share of a bit by which an edge on a serial line may be early or late: half of the margin to the middle
of the bit remains for the receiver's own error."""
DATA_BITS = 8
STOP = DATA_BITS + 1


def pin_index(name: str) -> int:
    """Return a pin's index in `PINS`. Raises InputError."""
    if name.upper() in PINS:
        return PINS.index(name.upper())
    raise InputError("unknown-pin", f"there is no pin '{name}'", hint=did_you_mean(name, PINS))


class Signals(ABC):
    """Edges of the pins, and what tests ask about them.

    Times count from reset on the simulated chip and from the beginning of a capture. `since_us` leaves out
    what began earlier.
    """

    @abstractmethod
    def pieces(self) -> Sequence[EdgeTrace]:
        """Return the edges: of one run of the chip, or of each of several captures."""

    @abstractmethod
    def chip_clock(self) -> Clock:
        """Return the clock of the chip, whose cycles times are counted in."""

    def seen_pin(self, name: str) -> int:
        """Return the index in `PINS` of a pin that was looked at. Raises InputError."""
        return pin_index(name)

    def levels(self) -> Sequence[EdgeTrace]:
        """Return the levels at the pins, with those that came from outside as far as they are known."""
        return self.pieces()

    @property
    def from_reset(self) -> bool:
        """Return whether the first piece begins with the chip's reset."""
        return True

    def check_contract(self, contract: str | Path, *, partial: bool = False) -> None:
        """Fail unless a contract was kept: a TOML file, or its text. See docs/contracts.md.

        A clause of which nothing was seen fails, too, unless `partial`.
        """
        is_text = isinstance(contract, str) and "\n" in contract
        read = parse_contract(contract, "the contract") if is_text else load_contract(contract)  # type: ignore[arg-type]
        clauses = read.clauses(self.chip_clock())
        for number, piece in enumerate(self.levels()):
            begins = self.from_reset and number == 0
            verdict = judge_contract(clauses, piece, from_reset=begins, capture=not self.from_reset)
            if not verdict.accepted(partial):
                raise AssertionError("\n".join(verdict.lines()))

    def rising(self, pin: str, *, since_us: float = 0) -> list[int]:
        """Return the cycle of each rising edge."""
        return self._cycles(self._edges(pin, HIGH, since_us))

    def rising_us(self, pin: str, *, since_us: float = 0) -> list[float]:
        """Return the time of each rising edge in µs."""
        return [float(time) for time in self._edges(pin, HIGH, since_us)]

    def falling(self, pin: str, *, since_us: float = 0) -> list[int]:
        """Return the cycle of each falling edge."""
        return self._cycles(self._edges(pin, LOW, since_us))

    def falling_us(self, pin: str, *, since_us: float = 0) -> list[float]:
        """Return the time of each falling edge in µs."""
        return [float(time) for time in self._edges(pin, LOW, since_us)]

    def widths(self, pin: str, *, level: int = HIGH, since_us: float = 0) -> list[int]:
        """Return the length of each pulse in cycles: of the high ones, or with `level=0` the low ones."""
        return self._cycles(self._widths(pin, level, since_us))

    def widths_us(self, pin: str, *, level: int = HIGH, since_us: float = 0) -> list[float]:
        """Return the length of each pulse in µs: of the high ones, or with `level=0` the low ones."""
        return [float(width) for width in self._widths(pin, level, since_us)]

    def periods(self, pin: str, *, since_us: float = 0) -> list[int]:
        """Return the time from each rising edge to the next in cycles."""
        return self._cycles(self._periods(pin, since_us))

    def periods_us(self, pin: str, *, since_us: float = 0) -> list[float]:
        """Return the time from each rising edge to the next in µs."""
        return [float(period) for period in self._periods(pin, since_us)]

    def uart(self, pin: str, baud: float, *, inverted: bool = False, since_us: float = 0) -> bytes:
        """Return the bytes sent on a pin: a start bit, eight bits, the lowest first, a stop bit.

        A pin that nothing drives is idle, and a start bit that ends before its middle is a disturbance. Fails
        where a stop bit is missing or an edge is more than a quarter of a bit from where it belongs.
        """
        if not 0 < baud <= self.chip_clock().cycles_per_second:
            raise InputError(
                "out-of-range",
                f"baud = {baud:g} is not between 0 and one bit in a cycle",
                hint=f"at most {float(self.chip_clock().cycles_per_second):g} with this clock",
            )
        index, idle = self.seen_pin(pin), LOW if inverted else HIGH
        received = b""
        for trace in self.pieces():
            line = _levels(trace, index, undriven=idle, since=Fraction(since_us))
            received += _decode(pin.upper(), line, Fraction(baud), idle, _us(trace, trace.end))
        return received

    def _cycles(self, times: Sequence[Moment]) -> list[int]:
        return [whole(time / self.chip_clock().cycle_us) for time in times]

    def _edges(self, pin: str, level: int, since_us: float) -> list[Moment]:
        found = []
        for trace, seen in self._pulses(pin):
            cycles = seen.rise[seen.rise > 0] if level == HIGH else seen.fall[seen.fall < trace.end]
            found += _since(since_us, trace, cycles)
        return found

    def _widths(self, pin: str, level: int, since_us: float) -> list[Moment]:
        """Return the lengths of the pulses, or of the gaps between them, that were seen whole."""
        found = []
        for trace, seen in self._pulses(pin):
            whole = seen.whole()
            begins, ends = (whole.rise, whole.fall) if level == HIGH else (seen.fall[:-1], seen.rise[1:])
            late = np.array([_us(trace, begin) >= since_us for begin in begins.tolist()], dtype=bool)
            found += [_us(trace, width) for width in (ends - begins)[late].tolist()]
        return found

    def _periods(self, pin: str, since_us: float) -> list[Moment]:
        return [
            later - earlier
            for trace, seen in self._pulses(pin)
            for earlier, later in pairwise(_since(since_us, trace, seen.rise[seen.rise > 0]))
        ]

    def _pulses(self, pin: str) -> Iterator[tuple[EdgeTrace, Pulses]]:
        """Yield each piece with the pulses of a pin in it."""
        index = self.seen_pin(pin)
        for trace in self.pieces():
            yield trace, pulses(trace).of(index)


def _since(since_us: float, trace: EdgeTrace, cycles: npt.NDArray[np.int64]) -> list[Moment]:
    return [moment for cycle in cycles.tolist() if (moment := _us(trace, cycle)) >= since_us]


def _us(trace: EdgeTrace, cycle: int) -> Moment:
    return trace.clock.us(cycle)


def _levels(trace: EdgeTrace, pin: int, undriven: int, since: Moment) -> list[Level]:
    """Return the level of a pin at the beginning, or at `since`, and each later change.

    The level at time 0 is what a capture begins with, not an edge.
    """
    edges = join(trace.chunks)
    own = np.flatnonzero(edges.pin == pin)
    line: list[Level] = [(Fraction(0), undriven)]
    for cycle, level in zip(edges.cycle[own].tolist(), edges.level[own].tolist(), strict=True):
        moment, driven = _us(trace, cycle), undriven if level == UNDRIVEN else level
        if moment <= since and (moment < since or cycle == 0):
            line = [(moment, driven)]
        elif driven != line[-1][1]:
            line.append((moment, driven))
    return line


def _decode(pin: str, line: Sequence[Level], baud: Fraction, idle: int, end: Moment) -> bytes:
    """Return the bytes on a line, as a receiver that samples each bit in its middle reads them."""
    bit = 1_000_000 / baud
    received = bytearray()
    free = Fraction(-1)
    """The end of the current byte."""
    for number, (start, level) in enumerate(line):
        if level == idle or not number or line[number - 1][1] != idle or start <= free:
            continue
        if start + (STOP + Fraction(1, 2)) * bit > end:
            break  # cut off
        middles = [start + (n + Fraction(1, 2)) * bit for n in range(STOP + 1)]
        bits = [int(_level_at(line, middle) == idle) for middle in middles]
        if bits[0]:
            continue
        free = middles[-1]
        inside = list(takewhile(partial(ge, free), (moment for moment, _ in islice(line, number + 1, None))))
        wrong = next((moment for moment in inside if _error(moment - start, bit) > MAX_BIT_ERROR), None)
        if wrong is not None or not bits[-1]:
            raise AssertionError(_bad_byte(pin, bytes(received), start, wrong, inside, bit))
        received.append(sum(value << n for n, value in enumerate(bits[1:STOP])))
    return bytes(received)


def _level_at(line: Sequence[Level], moment: Moment) -> int:
    low, high = 0, len(line)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if line[middle][0] <= moment else (low, middle)
    return line[low][1]


def _error(after: Moment, bit: Fraction) -> Fraction:
    """Return by how much of a bit an edge is off the nearest border between two bits."""
    return abs(after / bit - whole(after / bit))


def _bad_byte(
    pin: str, received: bytes, start: Moment, wrong: Moment | None, inside: Sequence[Moment], bit: Fraction
) -> str:
    baud = 1_000_000 / bit
    text = f"{pin} at {float(baud):g} baud: byte {len(received) + 1}, from {float(start):.10g} µs, "
    if wrong is None:
        text += "has no stop bit"
    else:
        off = float(100 * _error(wrong - start, bit))
        after = float(wrong - start)
        text += f"has an edge {off:.0f} % of a bit from where it belongs, {after:.10g} µs after its start"
    shortest = min((later - earlier for earlier, later in pairwise([start, *inside])), default=None)
    if shortest is not None:
        text += (
            f"; its shortest level lasts {float(shortest):.10g} µs, a bit is {float(bit):.5g} µs "
            f"(one of that length would be {float(1_000_000 / shortest):.5g} baud)"
        )
    return f"{text}; received before it: {received!r}"
