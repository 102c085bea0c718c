"""Where the edges of a program or a recording differ from its schedule, and what the schedule asks for.

In: a `PulseSchedule` and where it lies in the trace. Out: the expected edges of any window, and those that
differ. It is for display: the verdict is that of `verify`.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from math import ceil

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, LOW, PINS, Driven, EdgeChunk, EdgeTrace, edge_chunk, join
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Run

Edge = tuple[int, int, int]
"""(cycle, pin, level)"""
MAX_SPANS = 400
"""The maximum number of spans of differences: more than a slider has places to mark."""


@dataclass(frozen=True, slots=True)
class ScheduledEdges:
    """The schedule's edges placed in a trace: frame 0 begins at `origin`, and a cycle of the schedule is
    `steps` of the trace's time steps.

    An edge may be `tolerance` steps away: 0 for edges in cycles of the chip, which are exact. `begin` and
    `end` are the part of the trace that is compared with the schedule.
    """

    schedule: PulseSchedule
    origin: int | float
    steps: int | float = 1
    tolerance: float = 0
    begin: int = 0
    end: int | None = None
    beyond: int = 0
    """What is added to the numbers of the pins, which are those of the other one of two chips."""
    _ends: list[int] = field(init=False, repr=False, compare=False)
    """The frame after each run of the schedule."""

    def __post_init__(self) -> None:
        runs = (*self.schedule.lead_in, *self.schedule.loop)
        object.__setattr__(self, "_ends", list(accumulate(run.frames for run in runs)))

    @property
    def pins(self) -> npt.NDArray[np.uint8]:
        numbers = [PINS.index(channel.pin) + self.beyond for channel in self.schedule.channels]
        return np.array(numbers, dtype=np.uint8)

    @property
    def margin(self) -> int:
        """Return how far outside a window edges are looked at, to find the partner of each within it."""
        return ceil(self.tolerance)

    def at(self, cycle: int) -> int:
        """Return the time in the trace of a cycle of the schedule."""
        return round(self.origin + self.steps * cycle)

    def frame_at(self, moment: int) -> int:
        """Return the number of the frame that a moment is in; negative before the first one."""
        return int((moment - self.origin) // (self.steps * self.schedule.period))

    def frame_begin(self, frame: int) -> int:
        return self.at(frame * self.schedule.period)

    def run_at(self, frame: int) -> Run:
        """Return the pulses of a frame."""
        lead_in, ends = self.schedule.lead_in, self._ends
        first = ends[len(lead_in) - 1] if lead_in else 0
        if frame >= ends[-1]:
            frame = first + (frame - first) % (ends[-1] - first)
        number = bisect_right(ends, frame)
        return lead_in[number] if number < len(lead_in) else self.schedule.loop[number - len(lead_in)]

    def edges(self, begin: int, end: int) -> list[Edge]:
        """Return the edges from the moment `begin` up to `end`."""
        edges: list[Edge] = []
        pins = self.pins.tolist()
        near = 1 if self.tolerance else 0  # rounding moves an edge out of its frame
        frames = range(max(0, self.frame_at(begin) - near), self.frame_at(max(begin, end - 1)) + 1 + near)
        for frame in frames:
            start = frame * self.schedule.period
            for pin, pulse in zip(pins, self.run_at(frame).pulses, strict=True):
                if pulse:
                    rise = start + pulse.rise
                    edges += [(self.at(rise), pin, HIGH), (self.at(rise + pulse.width), pin, LOW)]
        last = end if self.end is None else min(end, self.end)
        return sorted(edge for edge in edges if max(begin, self.begin) <= edge[0] < last)


def first_rise(schedule: PulseSchedule) -> int | None:
    """Return the cycle of the schedule's first edge, from the beginning of frame 0; None: it has no pulse."""
    unplaced = ScheduledEdges(schedule, 0)
    for frame in range(schedule.lead_in_frames + schedule.loop_frames):
        rises = [pulse.rise for pulse in unplaced.run_at(frame).pulses if pulse]
        if rises:
            return frame * schedule.period + min(rises)
    return None


def place_schedule(schedule: PulseSchedule, trace: EdgeTrace, beyond: int = 0) -> ScheduledEdges | None:
    """Return the schedule as it begins with the trace's first pulse; None where there is none."""
    pins = {PINS.index(channel.pin) + beyond for channel in schedule.channels}
    first = first_rise(schedule)
    for chunk in trace.driven():
        rising = np.flatnonzero(np.isin(chunk.pin, list(pins)) & (chunk.level == HIGH))
        if len(rising) and first is not None:
            return ScheduledEdges(schedule, int(chunk.cycle[rising[0]]) - first, beyond=beyond)
    return None


def differing(
    wanted: ScheduledEdges, edges: EdgeChunk, begin: int, end: int, asked: list[Edge] | None = None
) -> list[Edge]:
    """Return the edges of a window that only one of the two has; `edges` count an undriven pin as low.

    `edges` must reach `wanted.margin` beyond the window. So must `asked`, the scheduled edges, if they are
    known already.
    """
    last = end if wanted.end is None else min(end, wanted.end)
    first = max(begin, wanted.begin)
    if asked is None:
        asked = wanted.edges(begin - wanted.margin, end + wanted.margin)
    mine = np.isin(edges.pin, wanted.pins) & (edges.cycle >= wanted.at(0) - wanted.margin)
    seen = list(zip(*(column[mine].tolist() for column in edges), strict=True))
    alone = _alone(asked, seen, wanted.tolerance) | _alone(seen, asked, wanted.tolerance)
    return sorted(edge for edge in alone if first <= edge[0] < last)


def _alone(edges: list[Edge], others: list[Edge], tolerance: float) -> set[Edge]:
    """Return the edges that have no partner among the others: the same pin and level at about that time."""
    if not tolerance:
        return set(edges) - set(others)
    times: dict[tuple[int, int], list[int]] = {}
    for time, pin, level in sorted(others):
        times.setdefault((pin, level), []).append(time)
    alone = set()
    for time, pin, level in edges:
        near = times.get((pin, level), [])
        place = bisect_left(near, time - tolerance)
        if place == len(near) or near[place] > time + tolerance:
            alone.add((time, pin, level))
    return alone


def differences(wanted: ScheduledEdges, trace: EdgeTrace, end: int) -> Iterator[int]:
    """Yield the cycles of the edges before `end` that only one of them has, in order."""
    driven = Driven()
    begin = 0
    for chunk in _pieces(trace, wanted.schedule.period):
        until = min(end, chunk[1])
        yield from (edge[0] for edge in differing(wanted, driven(chunk[0]), begin, until))
        begin = until
        if begin >= end:
            break


def spans(cycles: Iterable[int], gap: int) -> tuple[tuple[int, int], ...]:
    """Return the spans of cycles in order that are at most `gap` apart, the first `MAX_SPANS` of them."""
    found: list[tuple[int, int]] = []
    for cycle in cycles:
        if found and cycle - found[-1][1] <= gap:
            found[-1] = found[-1][0], cycle
        elif len(found) == MAX_SPANS:
            break
        else:
            found.append((cycle, cycle))
    return tuple(found)


def _pieces(trace: EdgeTrace, length: int) -> Iterator[tuple[EdgeChunk, int]]:
    """Yield the edges in pieces and up to which cycle each is complete."""
    left = edge_chunk((), (), ())
    for chunk in trace.chunks:
        left = join((left, chunk))
        if len(left.cycle) and int(left.cycle[-1]) - int(left.cycle[0]) > length:
            until = int(left.cycle[-1])  # more edges may follow in the same cycle
            whole = int(np.searchsorted(left.cycle, until))
            yield EdgeChunk(left.cycle[:whole], left.pin[:whole], left.level[:whole]), until
            left = EdgeChunk(left.cycle[whole:], left.pin[whole:], left.level[whole:])
    yield left, int(trace.end)
