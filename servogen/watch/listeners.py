"""`SerialListener` and `BusListener`: what is said on a line, as it comes.

In: edges of a run, in order. Out: `Said`, the bytes of an asynchronous line, or those of an I²C bus with
start, stop and acknowledges.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import groupby
from typing import NamedTuple

import numpy as np

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeChunk
from servogen.units import Clock

BITS = 8
MAX_WAITING = 4096
"""The maximum number of bytes that wait to be taken; the oldest ones are dropped."""


class Said(NamedTuple):
    """A byte, or what else is said, from one cycle to another."""

    begin: int
    end: int
    text: str


class SerialListener:
    """Decodes one pin at one baud rate: a line that idles high, a start bit, eight bits (the lowest first), a
    stop bit; a byte without its stop bit is none.
    """

    def __init__(self, pin: int, baud: Fraction, clock: Clock) -> None:
        self.pin, self.pins, self.baud = pin, (pin,), baud
        self._bit = clock.cycles_per_second / baud
        self._said: list[Said] = []
        self.restart(())

    @property
    def model(self) -> dict[str, object]:
        return {"pin": PINS[self.pin], "baud": int(self.baud)}

    def restart(self, levels: Sequence[int]) -> None:
        """Begin anew at a moment before which the pins had these levels."""
        self._level = levels[self.pin] if levels else LOW
        self._start: Fraction | None = None
        self._value = self._taken = 0

    def add(self, edges: EdgeChunk, now: int) -> None:
        """Take the edges up to `now`."""
        mine = np.flatnonzero(edges.pin == self.pin)
        for cycle, level in zip(edges.cycle[mine].tolist(), edges.level[mine].tolist(), strict=True):
            self._sample(cycle)
            if self._start is None and self._level == HIGH and level == LOW:
                self._start, self._value, self._taken = Fraction(cycle), 0, 0
            self._level = level
        self._sample(now)

    def taken(self) -> list[Said]:
        """Return the bytes since the last time, as two hexadecimal digits each."""
        said, self._said = self._said[-MAX_WAITING:], []
        return said

    def _sample(self, until: int) -> None:
        """Take the bits whose middle lies before `until`: until then the level has not changed."""
        while self._start is not None:
            middle = self._start + (Fraction(3, 2) + self._taken) * self._bit
            if middle >= until:
                return
            if self._taken < BITS:
                self._value |= (self._level == HIGH) << self._taken
                self._taken += 1
            else:
                if self._level == HIGH:
                    end = self._start + (BITS + 2) * self._bit
                    self._said.append(Said(int(self._start), int(end), f"{self._value:02X}"))
                self._start = None


def byte_clocks(edges: EdgeChunk, scl: int, sda: int) -> int | None:
    """Return how many clocks an I²C bus's unfinished byte has had after `edges`; None if not known."""
    mine = np.flatnonzero(np.isin(edges.pin, (scl, sda)))
    mine = mine[np.lexsort((edges.pin[mine] != scl, edges.cycle[mine]))]
    cycle, clock, level = edges.cycle[mine], edges.pin[mine] == scl, edges.level[mine]
    latest = np.maximum.accumulate(np.where(clock, np.arange(len(mine)), -1))
    high = (latest >= 0) & (level[latest] == HIGH) & (cycle[latest] < cycle)
    marks = np.flatnonzero(~clock & high)  # starts and stops: SCL does not change with SDA
    if not len(marks) or level[marks[-1]] != LOW:
        return None
    clocks = level[marks[-1] :][clock[marks[-1] :]]
    return None if (clocks == UNDRIVEN).any() else int((clocks == HIGH).sum()) % (BITS + 1)


class BusListener:
    """Decodes an I²C bus: "S 50 W A" is a start with an address, "0D A" an acknowledged byte, "FF N" one that
    is not, "P" a stop.
    """

    def __init__(self, scl: int, sda: int, clocks: int | None = None) -> None:
        """Begin after `clocks` of the current byte; None: nothing is decoded before a start."""
        self.pin = sda
        self.pins = scl, sda
        self._bits = clocks
        self._address = False
        self._value = 0
        self._begin: int | None = None
        """The beginning of the current byte; None: it was not seen."""
        self._said: list[Said] = []
        self.restart(())

    def restart(self, levels: Sequence[int]) -> None:
        """Begin at a moment before which the pins had these levels, within the same byte."""
        self._levels = [levels[pin] if levels else HIGH for pin in self.pins]

    def add(self, edges: EdgeChunk, now: int) -> None:
        """Take the edges up to `now`."""
        mine = np.isin(edges.pin, self.pins)
        rows = zip(*(column[mine].tolist() for column in edges), strict=True)
        for cycle, changes in groupby(rows, lambda row: row[0]):
            (clock, data), places = self._levels, self.pins.index
            for _, pin, level in changes:
                self._levels[places(pin)] = level
            if self._levels[0] == UNDRIVEN:  # between two pieces of a capture
                self._bits = None
            elif self._levels[0] == HIGH and clock != UNDRIVEN:
                self._high(cycle, rises=clock == LOW, changed=data != self._levels[1])

    def _high(self, cycle: int, *, rises: bool, changed: bool) -> None:
        """Take a bit where SCL rises, or a start or a stop where SDA changes while it is high."""
        high = self._levels[1] != LOW
        if rises and self._bits is not None:
            self._take(cycle, high)
        elif changed and not rises:
            if high and self._bits is not None:
                self._said.append(Said(cycle, cycle, "P"))
            self._bits, self._address, self._begin = (None if high else 0), not high, cycle

    def _take(self, cycle: int, bit: bool) -> None:
        """Take a bit of a byte or, after eight, its acknowledge."""
        assert self._bits is not None
        if not self._bits and not self._address:
            self._begin = cycle
        self._bits += 1
        if self._bits <= BITS:
            self._value = self._value << 1 & 0xFF | bit
            return
        if self._begin is not None:
            direction = "RW"[not self._value & 1]
            byte = f"S {self._value >> 1:02X} {direction}" if self._address else f"{self._value:02X}"
            self._said.append(Said(self._begin, cycle, f"{byte} {'N' if bit else 'A'}"))
        self._bits, self._address, self._begin = 0, False, None

    def taken(self) -> list[Said]:
        """Return what was said since the last time."""
        said, self._said = self._said, []
        return said
