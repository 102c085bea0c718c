"""`Recording`: the edges of a capture, gone through like a running program.

In: an `EdgeTrace` in memory. Out: the same moments, edges and levels as from a `TimeMachine`; nothing runs.
"""

from __future__ import annotations

from collections.abc import Set

import numpy as np

from servogen.edges import PINS, UNDRIVEN, EdgeChunk, EdgeTrace, join, part
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
        before = self.edges(0, begin)
        levels = [UNDRIVEN] * len(PINS)
        for pin in range(len(PINS)):
            mine = np.flatnonzero(before.pin == pin)
            if len(mine):
                levels[pin] = int(before.level[mine[-1]])
        return tuple(levels)

    def step_edge(self, forwards: bool, pins: Set[int] = frozenset()) -> bool:
        """Go to just after the next or the previous edge of one of `pins` (none: of any)."""
        mine = np.isin(self._edges.pin, list(pins)) if pins else np.ones(len(self._edges.pin), dtype=bool)
        after = np.unique(self._edges.cycle[mine]) + 1
        place = int(np.searchsorted(after, self.now, "right" if forwards else "left")) - (not forwards)
        if not 0 <= place < len(after):
            return False
        self.now = Cycles(int(after[place]))
        return True
