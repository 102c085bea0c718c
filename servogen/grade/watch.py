"""Every pulse of every pin while a program is watched: a trace goes in, arrays of rises and falls come out.

A program that toggles a pin far faster than a servo could follow is watched only until that is clear.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, EdgeTrace, join
from servogen.units import Clock

Ints = npt.NDArray[np.int64]

MOST_EDGES = 1_000_000
"""13 servos for an hour make fewer by far in any lab's time."""

PAUSE_PERIODS = 3
"""A time from rise to rise of more than so many (median) periods has a pause in it."""


class PinPulses(NamedTuple):
    """The whole pulses of one pin, in cycles."""

    rise: Ints
    fall: Ints

    @property
    def period(self) -> int:
        """The median of the times from rise to rise; 0 where there is none."""
        return int(np.median(np.diff(self.rise))) if len(self.rise) > 1 else 0

    @property
    def longest_period(self) -> int:
        """A longer time from rise to rise has a pause in it."""
        return PAUSE_PERIODS * self.period

    def periods(self, begin: int, end: int) -> Ints:
        """Times from rise to rise of neighbours that both rise in [begin, end), pauses left out."""
        inside = self.rise[(self.rise >= begin) & (self.rise < end)]
        gaps = np.diff(inside)
        return gaps[gaps <= self.longest_period]

    def silence(self, begin: int, end: int) -> int:
        """The longest pause that begins in [begin, end), as far as it lies therein; 0: none."""
        fall = self.fall
        following = np.append(self.rise[1:], np.iinfo(np.int64).max)
        pause = (fall >= begin) & (fall < end) & (following - self.rise > self.longest_period)
        return int((np.minimum(following[pause], end) - fall[pause]).max(initial=0))


@dataclass(frozen=True, slots=True)
class Watched:
    """What was seen up to cycle `end`; pins without a whole pulse are not in `pins`."""

    clock: Clock
    end: int
    pins: Mapping[int, PinPulses]
    high_since: Mapping[int, int]
    """Pins that are high at the end, and since which cycle."""
    too_fast: bool
    """The watch ended early: there were more edges than servos can use."""


def watch(trace: EdgeTrace) -> Watched:
    """All pulses of `trace`."""
    chunks, edges = [], 0
    for chunk in trace.driven():
        chunks.append(chunk)
        edges += len(chunk.cycle)
        if edges > MOST_EDGES:
            break
    too_fast = edges > MOST_EDGES
    seen = join(chunks)
    end = int(seen.cycle[-1]) if too_fast else int(trace.end)
    pins, high_since = {}, {}
    for pin in np.unique(seen.pin).tolist():
        own = seen.pin == pin
        rise = seen.cycle[own & (seen.level == HIGH)]
        fall = seen.cycle[own & (seen.level != HIGH)]
        if len(fall) < len(rise):
            high_since[pin] = int(rise[-1])
        if len(fall):
            pins[pin] = PinPulses(rise[: len(fall)], fall)
    return Watched(trace.clock, end, pins, high_since, too_fast)
