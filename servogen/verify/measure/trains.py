"""The pulses of one pin, run-length encoded while they stream: equal neighbours share one row.

In: windows of edges. Out: rows (first rise, pulses, width, time from rise to next rise), all int64 cycles.
An hour of a servo program takes a few rows; `MOST_ROWS` limits traces that never repeat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from servogen.edges import HIGH
from servogen.verify.windows import Edges, Ints

MOST_ROWS = 1 << 16
LAST = -1
"""The period of the last pulse, which no other follows."""


@dataclass(frozen=True, slots=True)
class Train:
    """Rows of equal pulses in order; a pulse that the end of the trace cuts off is in none, but rises at
    `open_rise`.
    """

    first: Ints
    count: Ints
    width: Ints
    period: Ints
    open_rise: int | None


class TrainBuilder:
    """Encodes the windows of a trace, taken in order, for one pin."""

    def __init__(self, pin: int) -> None:
        self._pin = pin
        self._rise: Ints = np.zeros(0, dtype=np.int64)
        self._width: Ints = np.zeros(0, dtype=np.int64)
        self._parts: list[tuple[Ints, Ints, Ints, Ints]] = []
        self.rows = 0

    def add(self, edges: Edges) -> None:
        """Add the next window. A pulse is counted when the next one rises, because only then is its period
        known.
        """
        own = edges.take(edges.pin == self._pin)
        rising = own.level == HIGH
        rise = np.concatenate((self._rise, own.cycle[rising]))
        fall = own.cycle[~rising]
        waiting = len(self._width)
        width = np.concatenate((self._width, fall - rise[waiting : waiting + len(fall)]))
        known = max(0, len(rise) - 1)
        self._append(rise[:known], width[:known], np.diff(rise))
        self._rise, self._width = rise[known:], width[known:]

    def _append(self, rise: Ints, width: Ints, period: Ints) -> None:
        if not len(rise):
            return
        changes = np.flatnonzero((np.diff(width) != 0) | (np.diff(period) != 0)) + 1
        at = np.concatenate(([0], changes))
        count = np.diff(at, append=len(rise))
        self._parts.append((rise[at], count, width[at], period[at]))
        self.rows += len(at)

    def finish(self) -> Train:
        """Return what was counted; the last pulse has the period `LAST`."""
        if len(self._width):
            self._append(self._rise, self._width, np.full(1, LAST, dtype=np.int64))
        still_open = int(self._rise[0]) if len(self._rise) > len(self._width) else None
        if not self._parts:
            nothing = np.zeros(0, dtype=np.int64)
            return Train(nothing, nothing, nothing, nothing, still_open)
        first, count, width, period = (np.concatenate(column) for column in zip(*self._parts, strict=True))
        return _merged(first, count, width, period, still_open)


def _merged(first: Ints, count: Ints, width: Ints, period: Ints, still_open: int | None) -> Train:
    """Return the train with equal rows joined that were divided only by the border of a window."""
    starts = np.concatenate(([0], np.flatnonzero((np.diff(width) != 0) | (np.diff(period) != 0)) + 1))
    return Train(first[starts], np.add.reduceat(count, starts), width[starts], period[starts], still_open)
