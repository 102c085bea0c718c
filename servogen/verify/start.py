"""Finds the schedule's time zero in a trace: the first rising edge of a scheduled pin.

In: a trace and the scheduled pins. Out: that cycle, the edges from it on, and the pins that changed before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS, EdgeChunk, EdgeTrace, Expected, part
from servogen.units import Cycles
from servogen.verify.verdict import StrayPin
from servogen.verify.windows import Edges, Ints, observed_edges


@dataclass(frozen=True, slots=True)
class TraceStart:
    """`cycle` is None if no scheduled pin rises, and `edges` is then empty. Its cycles count from `cycle`."""

    cycle: int | None
    edges: Iterator[Edges]
    stray: tuple[StrayPin, ...]
    """The changes before `cycle`, which are all of unscheduled pins, because every pin starts low."""


class StrayCount:
    """Counts edges by pin."""

    def __init__(self) -> None:
        self._counts: Ints = np.zeros(len(PINS), dtype=np.int64)
        self._firsts: Ints = np.zeros(len(PINS), dtype=np.int64)

    def add(self, cycle: Ints, pin: npt.NDArray[np.uint8]) -> None:
        for number in np.flatnonzero(np.bincount(pin, minlength=len(PINS))).tolist():
            cycles = cycle[pin == number]
            if not self._counts[number]:
                self._firsts[number] = cycles[0]
            self._counts[number] += len(cycles)

    def pins(self) -> tuple[StrayPin, ...]:
        """Return the pins that changed, in the order of their numbers."""
        return tuple(
            StrayPin(pin, int(self._counts[pin]), Cycles(int(self._firsts[pin])))
            for pin in np.flatnonzero(self._counts).tolist()
        )


def channel_pins(expected: Expected) -> npt.NDArray[np.uint8]:
    """Return the scheduled pins."""
    return np.array([channel.pin for channel in expected.channels], dtype=np.uint8)


def find_start(observed: EdgeTrace, pins: npt.NDArray[np.uint8]) -> TraceStart:
    """Return the start, having read `observed` up to the first rising edge of one of `pins`."""
    driven = observed.driven()
    stray = StrayCount()
    for chunk in driven:
        rising = np.flatnonzero(np.isin(chunk.pin, pins) & (chunk.level == HIGH))
        if len(rising):
            start = int(chunk.cycle[rising[0]])
            before = int(np.searchsorted(chunk.cycle, start))
            stray.add(chunk.cycle[:before], chunk.pin[:before])
            return TraceStart(start, _from(start, part(chunk, slice(before, None)), driven), stray.pins())
        stray.add(chunk.cycle, chunk.pin)
    return TraceStart(None, iter(()), stray.pins())


def _from(start: int, rest: EdgeChunk, driven: Iterator[EdgeChunk]) -> Iterator[Edges]:
    yield observed_edges(rest, start)
    for chunk in driven:
        yield observed_edges(chunk, start)
