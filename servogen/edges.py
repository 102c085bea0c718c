"""`EdgeTrace`: what the pins did, and `Expected`: what they should do.

In: changes of pins, in order, in chunks of arrays, so that a day of edges needs no memory.
Out: the same changes, to whoever iterates. Files of them are in `traces`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.plan_error import PlanError
from servogen.units import Clock, Cycles

PINS = (*(f"RA{bit}" for bit in range(5)), *(f"RB{bit}" for bit in range(8)))
"""The thirteen pins; a pin's index here is its number in every trace."""

LOW, HIGH, UNDRIVEN = 0, 1, 2
"""Levels. A pin that nothing drives is `UNDRIVEN`: 0 in CSV, z in VCD."""


class EdgeChunk(NamedTuple):
    """Consecutive changes: `cycle` int64 (never falling), `pin` uint8 (index in `PINS`), `level` uint8."""

    cycle: npt.NDArray[np.int64]
    pin: npt.NDArray[np.uint8]
    level: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class EdgeTrace:
    """The changes of the thirteen pins from cycle 0, all `UNDRIVEN`, up to but not including `end`.

    `chunks` may be consumed once when the source is a running machine; `stored` makes it a sequence.
    A change that a chip makes is at the instruction cycle in which the port was written.
    """

    clock: Clock
    chunks: Iterable[EdgeChunk]
    end: Cycles

    def stored(self) -> EdgeTrace:
        """The same trace with all its edges in memory."""
        return EdgeTrace(self.clock, (join(self.chunks),), self.end)

    def driven(self) -> Iterator[EdgeChunk]:
        """The changes with an undriven pin counted as low: what the CSV file and a verifier see."""
        driven = Driven()
        return (driven(chunk) for chunk in self.chunks)

    def until(self, end: int) -> EdgeTrace:
        """The same trace cut at cycle `end`; a trace that is shorter stays as it is."""
        if end >= self.end:
            return self
        return EdgeTrace(self.clock, _before(self.chunks, end), Cycles(end))


class Changes:
    """A filter that drops what changes nothing; each pin starts at `start`, and chunks follow one another."""

    def __init__(self, start: int = UNDRIVEN) -> None:
        self._level = np.full(len(PINS), start, dtype=np.uint8)

    def __call__(self, chunk: EdgeChunk) -> EdgeChunk:
        keep = np.zeros(len(chunk.pin), dtype=bool)
        for pin in np.flatnonzero(np.bincount(chunk.pin, minlength=len(PINS))):
            at = np.flatnonzero(chunk.pin == pin)
            level = chunk.level[at]
            keep[at[1:]] = level[1:] != level[:-1]
            keep[at[0]] = level[0] != self._level[pin]
            self._level[pin] = level[-1]
        return chunk if keep.all() else part(chunk, keep)


class Driven:
    """A filter that counts an undriven pin as low and drops what changes nothing then."""

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
    """The edges that a schedule asks for, time zero being the first; each knows its frame and channel.

    `chunks` are in order, never empty, and may be endless; frames are numbered from 0. An edge of pin
    `channels[n].pin` belongs to channel n. `lead_in` and `loop` count frames; the loop repeats for ever.
    """

    clock: Clock
    period: Cycles
    channels: tuple[ExpectedChannel, ...]
    lead_in: int
    loop: int
    chunks: Iterable[ExpectedChunk]
    plan_error: PlanError | None = None
    """How far the schedule is from the motion that it was rounded from; None: nothing says."""


@dataclass(frozen=True, slots=True)
class ExpectedChannel:
    """A servo's channel: its name and its pin's index in `PINS`."""

    name: str
    pin: int


class ExpectedChunk(NamedTuple):
    """Consecutive expected changes, with the `frame` (int64) that each belongs to."""

    cycle: npt.NDArray[np.int64]
    pin: npt.NDArray[np.uint8]
    level: npt.NDArray[np.uint8]
    frame: npt.NDArray[np.int64]


def join(chunks: Iterable[EdgeChunk]) -> EdgeChunk:
    """All of `chunks` as one."""
    parts = list(chunks)
    if not parts:
        return edge_chunk((), (), ())
    return EdgeChunk(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def part(chunk: EdgeChunk, rows: slice | npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> EdgeChunk:
    """The edges of `chunk` that `rows` chooses."""
    return EdgeChunk(chunk.cycle[rows], chunk.pin[rows], chunk.level[rows])


def edge_chunk(cycle: npt.ArrayLike, pin: npt.ArrayLike, level: npt.ArrayLike) -> EdgeChunk:
    """A chunk of the right types from any three sequences of the same length."""
    return EdgeChunk(
        np.asarray(cycle, dtype=np.int64), np.asarray(pin, dtype=np.uint8), np.asarray(level, dtype=np.uint8)
    )
