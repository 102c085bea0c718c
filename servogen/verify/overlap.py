"""Finds pulses of two pins at the same time that never overlap in the schedule."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS
from servogen.units import Cycles
from servogen.verify.verdict import Overlap
from servogen.verify.windows import Edges, Ints

Levels = npt.NDArray[np.uint8]

_ALL: Levels = np.arange(len(PINS), dtype=np.uint8)


def masks(edges: Edges, initial: Levels, pins: Levels) -> tuple[Ints, Ints]:
    """Return (cycle, pins that are high from it on, as bits) for each cycle in which one of `pins`
    changes.
    """
    own = edges.take(np.isin(edges.pin, pins))
    before = sum(1 << int(pin) for pin in pins if initial[pin])
    bit = np.int64(1) << own.pin.astype(np.int64)
    high = before + np.cumsum(np.where(own.level == HIGH, bit, -bit))
    last = np.diff(own.cycle, append=own.cycle[-1] + 1 if len(own.cycle) else 0) > 0
    return own.cycle[last], high[last]


def pairs(mask: int) -> set[tuple[int, int]]:
    """Return the pairs of pins that are high together in `mask`."""
    high = [pin for pin in range(len(PINS)) if mask >> pin & 1]
    return {(one, other) for one in high for other in high if one < other}


def together(edges: Edges, initial: Levels, pins: Levels) -> set[tuple[int, int]]:
    """Return the pairs of `pins` that are high together anywhere in `edges`."""
    _, high = masks(edges, initial, pins)
    return set().union(*(pairs(mask) for mask in np.unique(high).tolist()))


def overlap(
    seen: Edges, allowed: set[tuple[int, int]], initial: Levels, pins: Levels, end: int
) -> Overlap | None:
    """Return the overlap in `seen`, up to `end`, of pins that are not an `allowed` pair."""
    cycle, high = masks(seen, initial, pins)
    wrong = [mask for mask in np.unique(high).tolist() if pairs(mask) - allowed]
    if not wrong:
        return None
    bad = np.isin(high, wrong)
    starts = np.flatnonzero(bad & ~np.concatenate(([False], bad[:-1])))
    ends = np.flatnonzero(bad & ~np.concatenate((bad[1:], [False])))
    until = np.concatenate((cycle[1:], [end]))[ends]
    first = min(pairs(int(high[starts[0]])) - allowed)
    longest = Cycles(int((until - cycle[starts]).max()))
    return Overlap(len(starts), longest, Cycles(int(cycle[starts[0]])), first)


class OverlapCount:
    """Counts, window by window, the times at which two or more pins are high."""

    def __init__(self) -> None:
        self._level: Levels = np.zeros(len(PINS), dtype=np.uint8)
        self._since: int | None = None
        self._pins = (0, 0)
        self._first = 0
        self._count = 0
        self._longest = 0

    def add(self, edges: Edges) -> None:
        cycle, high = masks(edges, self._level, _ALL)
        self._level[edges.pin] = edges.level
        if not len(cycle):
            return
        many = (high & (high - 1)) != 0
        before = np.concatenate(([self._since is not None], many[:-1]))
        starts = np.flatnonzero(many & ~before)
        if len(starts) and not self._count:
            self._first = int(cycle[starts[0]])
            self._pins = min(pairs(int(high[starts[0]])))
        self._count += len(starts)
        opened = np.concatenate(([] if self._since is None else [self._since], cycle[starts])).astype(
            np.int64
        )
        closed = cycle[~many & before]
        lengths = closed - opened[: len(closed)]
        self._longest = max(self._longest, int(lengths.max(initial=0)))
        self._since = int(opened[-1]) if many[-1] else None

    def finish(self, end: int) -> Overlap | None:
        """Return the overlap up to cycle `end`; None if no two pins were ever high together."""
        if self._since is not None:
            self._longest = max(self._longest, end - self._since)
        if not self._count:
            return None
        return Overlap(self._count, Cycles(self._longest), Cycles(self._first), self._pins)
