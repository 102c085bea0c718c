"""`Recording`: the edges of a capture, gone through like a running program; `LatestEdges`: those of a run.

In: an `EdgeTrace` in memory, or edges as they are made. Out: the same edges and levels as from a
`TimeMachine`; nothing runs.
"""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np

from servogen.edges import PINS, UNDRIVEN, EdgeChunk, EdgeTrace, edge_chunk, join, part
from servogen.units import Cycles


class Recording:
    """A recording and a moment in it."""

    def __init__(self, trace: EdgeTrace) -> None:
        self._edges = join(trace.chunks)
        self.end = trace.end
        self.now = Cycles(0)

    @property
    def reach(self) -> Cycles:
        return self.end

    def seek(self, cycle: int) -> None:
        """Go to a cycle, or to the nearest end."""
        self.now = Cycles(max(0, min(int(cycle), int(self.end))))

    def edges(self, begin: int, end: int) -> EdgeChunk:
        """Return the edges of the cycles from `begin` up to `end`."""
        first, last = np.searchsorted(self._edges.cycle, (begin, end))
        return part(self._edges, slice(int(first), int(last)))

    def levels_before(self, begin: int) -> tuple[int, ...]:
        """Return the level of each pin before cycle `begin`."""
        return _levels((UNDRIVEN,) * len(PINS), self.edges(0, begin))

    def step_edge(self, forwards: bool, pins: Set[int] = frozenset()) -> bool:
        """Go to just after the next or the previous edge of one of `pins` (none: of any)."""
        mine = np.isin(self._edges.pin, list(pins)) if pins else np.ones(len(self._edges.pin), dtype=bool)
        after = np.unique(self._edges.cycle[mine]) + 1
        place = int(np.searchsorted(after, self.now, "right" if forwards else "left")) - (not forwards)
        if not 0 <= place < len(after):
            return False
        self.now = Cycles(int(after[place]))
        return True


class LatestEdges:
    """The edges of the latest cycles of a run, from `begin` on, so that the waves need no second run."""

    def __init__(self, begin: int, levels: Sequence[int]) -> None:
        """Begin with the level of each pin before cycle `begin`."""
        self.begin = self.end = begin
        self._levels = tuple(levels)
        self._edges = edge_chunk((), (), ())

    def add(self, edges: EdgeChunk, end: int, keep: int) -> None:
        """Take the edges of the cycles up to `end`; of the past at least `keep` cycles are kept."""
        self._edges, self.end = join((self._edges, edges)), end
        if end - self.begin > 2 * keep:
            self._levels = self.levels_before(end - keep)
            self._edges = self.edges(end - keep, end)
            self.begin = end - keep

    def has(self, begin: int, end: int) -> bool:
        """Return whether all edges of the cycles from `begin` up to `end` are known here."""
        return self.begin <= begin <= self.end and end <= self.end

    def edges(self, begin: int, end: int) -> EdgeChunk:
        """Return the edges of the cycles from `begin` up to `end`."""
        first, last = np.searchsorted(self._edges.cycle, (begin, end))
        return part(self._edges, slice(int(first), int(last)))

    def levels_before(self, begin: int) -> tuple[int, ...]:
        """Return the level of each pin before cycle `begin`."""
        return _levels(self._levels, self.edges(self.begin, begin))


def _levels(levels: tuple[int, ...], edges: EdgeChunk) -> tuple[int, ...]:
    """Return the level of each pin after some edges, from those before."""
    after = np.array(levels, dtype=np.uint8)
    after[edges.pin] = edges.level  # of several values for one pin NumPy keeps the last
    return tuple(after.tolist())
