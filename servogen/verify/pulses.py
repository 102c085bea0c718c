"""Pulses with the frames that they belong to: pairs observed with scheduled ones, and finds pulses that
overlap.

     rise      fall            rise      fall
      ┌─────────┐               ┌─────────┐
──────┘  width  └───────────────┘         └────
      │◀────────── period ─────▶│
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS, EdgeChunk, edge_chunk
from servogen.pulses import BEFORE_ALL, PulseReader, Pulses, joined
from servogen.units import Cycles
from servogen.verify.verdict import Overlap
from servogen.verify.windows import Edges, Ints

Rows = npt.NDArray[np.intp]


class FramedPulses(NamedTuple):
    """Pulses of one pin in order, int64. A pulse that the end of the stretch cuts off falls there."""

    rise: Ints
    fall: Ints
    frame: Ints

    @property
    def width(self) -> Ints:
        """Return the widths in cycles."""
        return self.fall - self.rise

    def take(self, rows: npt.NDArray[np.bool_] | Rows) -> FramedPulses:
        return FramedPulses(self.rise[rows], self.fall[rows], self.frame[rows])


class CutPulses(NamedTuple):
    """The steps of the fall of a pulse that began before the capture, and of the rise of one that continues
    after it.
    """

    high: bool
    """Whether the pin was high at the beginning."""
    first_fall: int | None
    last_rise: int | None

    @property
    def high_throughout(self) -> bool:
        """Whether the pin never changed, and was high."""
        return self.high and self.first_fall is None


def cut_pulses(seen: Pulses, end: int) -> CutPulses:
    """Return the edges of the cut pulses of one pin in a capture from time 0 to `end`."""
    cut = seen.take(~seen.complete)
    high = bool(len(cut.rise)) and int(cut.rise[0]) <= 0
    first_fall = int(cut.fall[0]) if high and int(cut.fall[0]) < end else None
    unfinished = bool(len(cut.rise)) and int(cut.rise[-1]) > 0
    return CutPulses(high, first_fall, int(cut.rise[-1]) if unfinished else None)


def framed_pulses(
    edges: Edges, pin: int, end: int, open_rise: int | None = None, open_frame: int = -1
) -> FramedPulses:
    """Return the pulses of `pin` in `edges`, up to time `end`; `open_rise` is the rise of one that began
    before.
    """
    own = edges.take(edges.pin == pin)
    frame = own.frame[own.level == HIGH]
    reader = PulseReader(BEFORE_ALL)
    if open_rise is not None:
        reader(edge_chunk([open_rise], [pin], [HIGH]))
        frame = np.concatenate(([open_frame], frame))
    found = joined([reader(EdgeChunk(own.cycle, own.pin, own.level)), reader.cut(end)])
    return FramedPulses(found.rise, found.fall, frame)


def without_glitches(seen: FramedPulses, scheduled: FramedPulses, shortest: int) -> tuple[FramedPulses, int]:
    """Return `seen` without pulses and gaps of fewer than `shortest` cycles, and the number of these.

    If the schedule itself has pulses or gaps that short, they are not glitches.
    """
    count = 0
    gaps = scheduled.rise[1:] - scheduled.fall[:-1]
    if len(seen.rise) and gaps.min(initial=shortest) >= shortest:
        long = seen.rise[1:] - seen.fall[:-1] >= shortest
        first = np.concatenate(([True], long))
        last = np.concatenate((long, [True]))
        count += int(np.count_nonzero(~long))
        seen = FramedPulses(seen.rise[first], seen.fall[last], seen.frame[first])
    if scheduled.width.min(initial=shortest) >= shortest:
        long = seen.width >= shortest
        count += int(np.count_nonzero(~long))
        seen = seen.take(long)
    return seen, count


def pair(scheduled: Ints, seen: Ints, farthest: int) -> tuple[Rows, Rows]:
    """Return the rows of the rises that belong together: each is nearest to the other, no farther than
    `farthest`.

    A missing pulse is therefore a single scheduled rise without a partner, however many pulses follow.
    """
    nothing: Rows = np.zeros(0, dtype=np.intp)
    if not len(scheduled) or not len(seen):
        return nothing, nothing
    of_scheduled, of_seen = nearest(scheduled, seen), nearest(seen, scheduled)
    rows = np.arange(len(scheduled))
    mutual = of_seen[of_scheduled] == rows
    close = np.abs(seen[of_scheduled] - scheduled) <= farthest
    matches = rows[mutual & close]
    return matches, of_scheduled[matches]


def nearest(of: npt.NDArray[np.int64 | np.float64], among: Ints) -> Rows:
    """Return, for each of `of`, the row of the nearest of `among`; of two equally near ones, the earlier."""
    right = np.searchsorted(among, of).clip(max=len(among) - 1)
    left = (right - 1).clip(min=0)
    earlier = np.abs(of - among[left]) <= np.abs(among[right] - of)
    return np.where(earlier, left, right)


Levels = npt.NDArray[np.uint8]

_ALL: Levels = np.arange(len(PINS), dtype=np.uint8)


def masks(edges: Edges, initial: Levels, pins: Levels) -> tuple[Ints, Ints]:
    """Return (cycle, pins that are high from it on, as bits) for each cycle in which one of `pins`
    changes.
    """
    wanted = np.zeros(len(PINS), dtype=np.bool_)
    wanted[pins] = True
    own = edges.take(wanted[edges.pin])
    before = sum(1 << int(pin) for pin in pins if initial[pin])
    bit = np.int64(1) << own.pin.astype(np.int64)
    high = before + np.cumsum(np.where(own.level == HIGH, bit, -bit))
    last = np.diff(own.cycle, append=own.cycle[-1] + 1 if len(own.cycle) else 0) > 0
    return own.cycle[last], high[last]


def pairs(mask: int) -> set[tuple[int, int]]:
    """Return the pairs of pins that are high together in `mask`."""
    high = [pin for pin in range(len(PINS)) if mask >> pin & 1]
    return {(lower, higher) for lower in high for higher in high if lower < higher}


def together(edges: Edges, initial: Levels, pins: Levels) -> set[tuple[int, int]]:
    """Return the pairs of `pins` that are high together anywhere in `edges`."""
    _, high = masks(edges, initial, pins)
    return set().union(*map(pairs, np.flatnonzero(np.bincount(high)).tolist()))


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
