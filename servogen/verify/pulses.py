"""Extracts pulses from edges, and pairs observed with scheduled pulses.

     rise      fall            rise      fall
      ┌─────────┐               ┌─────────┐
──────┘  width  └───────────────┘         └────
      │◀────────── period ─────▶│
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH
from servogen.verify.windows import Edges, Ints

Rows = npt.NDArray[np.intp]


class Pulses(NamedTuple):
    """Pulses of one pin in order, int64. A pulse that the end of the stretch cuts off falls there."""

    rise: Ints
    fall: Ints
    frame: Ints

    @property
    def width(self) -> Ints:
        return self.fall - self.rise

    def take(self, rows: npt.NDArray[np.bool_] | Rows) -> Pulses:
        return Pulses(self.rise[rows], self.fall[rows], self.frame[rows])


class CutPulses(NamedTuple):
    """The steps of the fall of a pulse that began before the capture, and of the rise of one that continues
    after it.
    """

    high: bool
    """Whether the pin was high at the beginning."""
    first_fall: int | None
    last_rise: int | None


def cut_pulses(rise: Ints, fall: Ints, high: bool) -> CutPulses:
    """Return the edges of cut pulses among all edges of a pin; `high` is the pin's level at the beginning."""
    first_fall = int(fall[0]) if high and len(fall) else None
    unfinished = len(rise) > 0 and len(rise) > len(fall) - high
    return CutPulses(high, first_fall, int(rise[-1]) if unfinished else None)


def pulses_of(edges: Edges, pin: int, end: int, open_rise: int | None = None, open_frame: int = -1) -> Pulses:
    """Return the pulses of `pin` in `edges`, up to time `end`; `open_rise` is the rise of one that began
    before.
    """
    own = edges.take(edges.pin == pin)
    rising = own.level == HIGH
    rise, fall, frame = own.cycle[rising], own.cycle[~rising], own.frame[rising]
    if open_rise is not None:
        rise = np.concatenate(([open_rise], rise))
        frame = np.concatenate(([open_frame], frame))
    if len(fall) < len(rise):
        fall = np.concatenate((fall, [end]))
    return Pulses(rise, fall, frame)


def without_glitches(seen: Pulses, scheduled: Pulses, shortest: int) -> tuple[Pulses, int]:
    """Return `seen` without pulses and gaps of fewer than `shortest` cycles, and the number of these.

    If the schedule itself has pulses or gaps that short, they are not glitches.
    """
    count = 0
    gaps = scheduled.rise[1:] - scheduled.fall[:-1]
    if len(seen.rise) > 1 and gaps.min(initial=shortest) >= shortest:
        long = seen.rise[1:] - seen.fall[:-1] >= shortest
        first = np.concatenate(([True], long))
        last = np.concatenate((long, [True]))
        count += int(np.count_nonzero(~long))
        seen = Pulses(seen.rise[first], seen.fall[last], seen.frame[first])
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
    kept = rows[mutual & close]
    return kept, of_scheduled[kept]


def nearest(of: npt.NDArray[np.int64 | np.float64], among: Ints) -> Rows:
    """Return, for each of `of`, the row of the nearest of `among`; of two equally near ones, the earlier."""
    right = np.searchsorted(among, of).clip(max=len(among) - 1)
    left = (right - 1).clip(min=0)
    earlier = np.abs(of - among[left]) <= np.abs(among[right] - of)
    return np.where(earlier, left, right)
