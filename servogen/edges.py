"""`EdgeTrace`: what the pins did, and `Expected`: what they should do.

In: changes of pins, in order, in chunks of arrays, so that a day of edges needs little memory. Out: the same
changes, by iteration. `traces` reads and writes them as files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.plan_error import PlanError
from servogen.units import Clock, Cycles

PINS = (*(f"RA{bit}" for bit in range(5)), *(f"RB{bit}" for bit in range(8)))
"""The thirteen pins; a pin's index here is its number in every trace."""

OTHER_PINS = 16
"""In a trace of two chips the pins of the second one, or of the one that is not shown, are numbered from here
on: numbers between are of other things at a chip, such as MCLR."""
PAIR_PINS = OTHER_PINS + len(PINS)
PIN_NAMES = dict(enumerate(PINS))
"""The pins of one chip by their numbers in a trace."""
CHIP_MARKS = ("1.", "2.")
"""What stands before the names of the pins of the first and the second of two chips."""
PAIR_NAMES = {
    number + begin: f"{mark}{pin}"
    for begin, mark in zip((0, OTHER_PINS), CHIP_MARKS, strict=True)
    for number, pin in enumerate(PINS)
}
"""The pins of two chips by their numbers in a trace."""

LOW, HIGH, UNDRIVEN = 0, 1, 2
"""Levels. A pin that nothing drives is `UNDRIVEN`: 0 in CSV, z in VCD."""


class EdgeChunk(NamedTuple):
    """Consecutive changes: `cycle` int64 (never falling), `pin` uint8 (index in `PINS`), `level` uint8."""

    cycle: npt.NDArray[np.int64]
    pin: npt.NDArray[np.uint8]
    level: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class EdgeTrace:
    """The changes of the thirteen pins, which begin `UNDRIVEN`, from cycle 0 up to but not including `end`.

    If the source is a running machine, `chunks` can be consumed only once; `stored` makes it a sequence. A
    change made by a chip has the instruction cycle in which the port was written.
    """

    clock: Clock
    chunks: Iterable[EdgeChunk]
    end: Cycles

    def __repr__(self) -> str:
        return f"<EdgeTrace of {float(self.clock.seconds(self.end)):g} s at {self.clock.hz / 1e6:g} MHz>"

    def stored(self) -> EdgeTrace:
        """Return the same trace with all edges in memory."""
        return EdgeTrace(self.clock, (join(self.chunks),), self.end)

    def driven(self) -> Iterator[EdgeChunk]:
        """Yield the changes, with undriven pins counted as low, as CSV files and the verifier do."""
        driven = Driven()
        return (driven(chunk) for chunk in self.chunks)

    def without(self, pins: Sequence[int]) -> EdgeTrace:
        """Return the trace without the changes of some pins."""
        if not pins:
            return self
        return EdgeTrace(self.clock, _Without(self.chunks, tuple(pins)), self.end)

    def until(self, end: int) -> EdgeTrace:
        """Return the trace cut at cycle `end`, or unchanged if it is shorter."""
        if end >= self.end:
            return self
        return EdgeTrace(self.clock, _before(self.chunks, end), Cycles(end))


@dataclass(frozen=True, slots=True)
class _Without:
    """Chunks without the changes of some pins; every iteration starts again."""

    chunks: Iterable[EdgeChunk]
    pins: tuple[int, ...]

    def __iter__(self) -> Iterator[EdgeChunk]:
        return (part(chunk, ~np.isin(chunk.pin, self.pins)) for chunk in self.chunks)


class Changes:
    """A filter for consecutive chunks that drops edges without a change; every pin begins at `start`."""

    def __init__(self, start: int = UNDRIVEN) -> None:
        self._level = np.full(PAIR_PINS, start, dtype=np.uint8)

    def __call__(self, chunk: EdgeChunk) -> EdgeChunk:
        keep = np.zeros(len(chunk.pin), dtype=bool)
        for pin in np.flatnonzero(np.bincount(chunk.pin, minlength=PAIR_PINS)):
            indices = np.flatnonzero(chunk.pin == pin)
            level = chunk.level[indices]
            keep[indices[1:]] = level[1:] != level[:-1]
            keep[indices[0]] = level[0] != self._level[pin]
            self._level[pin] = level[-1]
        return chunk if keep.all() else part(chunk, keep)


class Driven:
    """A filter that counts undriven pins as low and drops the edges that then change nothing."""

    def __init__(self) -> None:
        self._changes = Changes(LOW)

    def __call__(self, chunk: EdgeChunk) -> EdgeChunk:
        level = (chunk.level == HIGH).astype(np.uint8)
        return self._changes(EdgeChunk(chunk.cycle, chunk.pin, level))


def _before(chunks: Iterable[EdgeChunk], end: int) -> Iterator[EdgeChunk]:
    for chunk in chunks:
        size = int(np.searchsorted(chunk.cycle, end))
        yield part(chunk, slice(size))
        if size < len(chunk.cycle):
            return


@dataclass(frozen=True, slots=True)
class Expected:
    """The edges that a schedule specifies, with their frames and channels; time zero is the first edge.

    `chunks` are in order, never empty, and may be endless; frames are numbered from 0. An edge of pin
    `channels[n].pin` belongs to channel n. `lead_in` and `loop` are numbers of frames; the loop repeats
    endlessly.
    """

    clock: Clock
    period: Cycles
    channels: tuple[ExpectedChannel, ...]
    lead_in: int
    loop: int
    chunks: Iterable[ExpectedChunk]
    plan_error: PlanError | None = None
    """The distance of the schedule from the motion that it was rounded from; None if it is not known."""
    others: tuple[int, ...] = ()
    """The pins that the program moves for something else than pulses, which are not compared."""


@dataclass(frozen=True, slots=True)
class ExpectedChannel:
    """A servo's channel: its name and its pin's index in `PINS`."""

    name: str
    pin: int


class ExpectedChunk(NamedTuple):
    """Consecutive expected changes, with the `frame` (int64) of each change."""

    cycle: npt.NDArray[np.int64]
    pin: npt.NDArray[np.uint8]
    level: npt.NDArray[np.uint8]
    frame: npt.NDArray[np.int64]


def join(chunks: Iterable[EdgeChunk]) -> EdgeChunk:
    """Return all chunks as one; a single one is returned itself."""
    parts = list(chunks)
    if not parts:
        return NO_EDGES
    if len(parts) == 1:
        return parts[0]
    return EdgeChunk(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def part(chunk: EdgeChunk, rows: slice | npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> EdgeChunk:
    """Return the edges of `chunk` that `rows` selects."""
    return EdgeChunk(chunk.cycle[rows], chunk.pin[rows], chunk.level[rows])


def edge_chunk(cycle: npt.ArrayLike, pin: npt.ArrayLike, level: npt.ArrayLike) -> EdgeChunk:
    """Return a chunk with the right types from three sequences of equal length."""
    return EdgeChunk(
        np.asarray(cycle, dtype=np.int64), np.asarray(pin, dtype=np.uint8), np.asarray(level, dtype=np.uint8)
    )


NO_EDGES = edge_chunk((), (), ())
"""No edges."""
