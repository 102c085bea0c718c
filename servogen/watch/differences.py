"""Where the edges of a program or a recording differ from its schedule, and what the schedule asks for.

In: a `PulseSchedule` and the cycle of its first edge. Out: the expected edges of any window, and the first
difference. It is for looking at: the verdict is `verify`'s.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, LOW, PINS, Driven, EdgeChunk, EdgeTrace, edge_chunk, join
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Run
from servogen.units import Cycles

Edge = tuple[int, int, int]
"""(cycle, pin, level)"""


@dataclass(frozen=True, slots=True)
class Wanted:
    """The schedule's edges from power-up on; its first frame begins in cycle `origin`."""

    schedule: PulseSchedule
    origin: int

    @property
    def pins(self) -> npt.NDArray[np.uint8]:
        return np.array([PINS.index(channel.pin) for channel in self.schedule.channels], dtype=np.uint8)

    def frame_of(self, cycle: int) -> int:
        """Return the number of the frame that a cycle is in; negative before the first one."""
        return (cycle - self.origin) // self.schedule.period

    def begin_of(self, frame: int) -> int:
        return self.origin + frame * self.schedule.period

    def run_of(self, frame: int) -> Run:
        """Return the pulses of a frame."""
        schedule = self.schedule
        runs, place = schedule.lead_in, frame
        if frame >= schedule.lead_in_frames:
            runs, place = schedule.loop, (frame - schedule.lead_in_frames) % schedule.loop_frames
        for run in runs:
            if place < run.frames:
                return run
            place -= run.frames
        raise AssertionError("the runs have as many frames as the schedule says")

    def edges(self, begin: int, end: int) -> list[Edge]:
        """Return the edges of the cycles from `begin` up to `end`."""
        found = []
        for frame in range(max(0, self.frame_of(begin)), self.frame_of(max(begin, end - 1)) + 1):
            start = self.begin_of(frame)
            for channel, pulse in zip(self.schedule.channels, self.run_of(frame).pulses, strict=True):
                if pulse:
                    pin, rise = PINS.index(channel.pin), start + pulse.rise
                    found += [(rise, pin, HIGH), (rise + pulse.width, pin, LOW)]
        return sorted(edge for edge in found if begin <= edge[0] < end)


def wanted_of(schedule: PulseSchedule, trace: EdgeTrace) -> Wanted | None:
    """Return the schedule as it begins with the trace's first pulse; None where there is none."""
    pins = {PINS.index(channel.pin) for channel in schedule.channels}
    for chunk in trace.driven():
        rising = np.flatnonzero(np.isin(chunk.pin, list(pins)) & (chunk.level == HIGH))
        if len(rising):
            first = int(chunk.cycle[rising[0]])
            unplaced = Wanted(schedule, 0)
            frames = range(schedule.lead_in_frames + schedule.loop_frames)
            for frame in frames:
                rises = [pulse.rise for pulse in unplaced.run_of(frame).pulses if pulse]
                if rises:
                    return Wanted(schedule, first - min(rises) - frame * schedule.period)
            return None
    return None


def differing(wanted: Wanted, made: EdgeChunk, begin: int, end: int) -> list[Edge]:
    """Return the edges of a window that only one of the two has; `made` counts an undriven pin as low."""
    asked = set(wanted.edges(begin, end))
    mine = np.isin(made.pin, wanted.pins) & (made.cycle >= max(begin, wanted.origin)) & (made.cycle < end)
    rows = zip(*(column[mine].tolist() for column in made), strict=True)
    return sorted(asked ^ {(cycle, pin, level) for cycle, pin, level in rows})


def first_difference(wanted: Wanted, trace: EdgeTrace, end: int) -> Cycles | None:
    """Return the cycle of the first edge that only one of them has, before `end`; None: there is none."""
    driven = Driven()
    begin = 0
    for chunk in _pieces(trace, wanted.schedule.period):
        until = min(end, chunk[1])
        found = differing(wanted, driven(chunk[0]), begin, until)
        if found:
            return Cycles(found[0][0])
        begin = until
        if begin >= end:
            return None
    found = differing(wanted, edge_chunk((), (), ()), begin, min(end, trace.end))
    return Cycles(found[0][0]) if found else None


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
