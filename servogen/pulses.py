"""`Pulses`: the one reading of edges as pulses, for verdicts, grades, pictures and models.

In: an `EdgeTrace`, or its chunks one after the other. Out: the pulses of its pins, in the order of their
ends.

     rise      fall             A pulse is complete if both of its edges were seen. One that was high when
      ┌─────────┐               the trace began rises at its beginning, one that is high when it ends falls
──────┘  width  └──────         at its end, and neither is complete. A pin that nothing drives is low.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PAIR_PINS, EdgeChunk, EdgeTrace

LOW_SINCE = -1
BEFORE_ALL = -1
"""The `begin` of a reader whose rises have all been seen."""


class Pulses(NamedTuple):
    """Pulses of one or more pins: `pin` (index in `PINS`), `rise` and `width` in cycles, `complete`."""

    pin: npt.NDArray[np.uint8]
    rise: npt.NDArray[np.int64]
    width: npt.NDArray[np.int64]
    complete: npt.NDArray[np.bool_]

    @property
    def fall(self) -> npt.NDArray[np.int64]:
        """Return when each pulse ends, in cycles."""
        return self.rise + self.width

    def take(self, rows: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Pulses:
        return Pulses(self.pin[rows], self.rise[rows], self.width[rows], self.complete[rows])

    def of(self, pin: int) -> Pulses:
        """Return the pulses of one pin, in order."""
        return self.take(self.pin == pin)

    def whole(self) -> Pulses:
        """Return the complete pulses."""
        return self.take(self.complete)


NO_PULSES = Pulses(np.zeros(0, np.uint8), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.bool_))


class PulseReader:
    """Reads consecutive chunks of edges, cut anywhere; its memory is which pins are high, and since when.

    The level that a pin has at cycle `begin` was not seen to rise. Its state can be copied with `copy.copy`.
    """

    def __init__(self, begin: int = 0) -> None:
        self.begin = begin
        self._since = np.full(PAIR_PINS, LOW_SINCE, dtype=np.int64)

    def __copy__(self) -> PulseReader:
        other = PulseReader(self.begin)
        other._since = self._since.copy()
        return other

    def __call__(self, chunk: EdgeChunk) -> Pulses:
        """Return the pulses that end in a chunk of edges."""
        if not len(chunk.cycle):  # most steps of a physics engine see none
            return NO_PULSES
        # pin by pin, so that the edge before is that of the same pin; the ends in their own order again
        order = np.argsort(chunk.pin, kind="stable")
        pin, high = chunk.pin[order], chunk.level[order] == HIGH
        first = _first_of_pin(pin)
        before = np.where(first, self._since[pin] != LOW_SINCE, np.roll(high, 1))
        changes = high != before
        order, pin, high = order[changes], pin[changes], high[changes]
        cycle = chunk.cycle[order]
        first = _first_of_pin(pin)
        rise = np.where(first, self._since[pin], np.roll(cycle, 1))
        last = np.append(first[1:], True)[: len(pin)]
        self._since[pin[last]] = np.where(high[last], cycle[last], LOW_SINCE)
        ends = np.flatnonzero(~high & (cycle > self.begin))
        return self._pulses(*(column[ends[np.argsort(order[ends])]] for column in (pin, rise, cycle)))

    def high_since(self, pin: int) -> int | None:
        """Return the rise of the pulse that a pin is in; None if it is low."""
        since = int(self._since[pin])
        return None if since == LOW_SINCE else since

    def cut(self, end: int) -> Pulses:
        """Return the pulses that are not over at the end of the trace, cut off there."""
        pin = np.flatnonzero(self._since != LOW_SINCE).astype(np.uint8)
        found = self._pulses(pin, self._since[pin], np.full(len(pin), end, dtype=np.int64))
        return found._replace(complete=np.zeros(len(pin), dtype=np.bool_))

    def _pulses(
        self, pin: npt.NDArray[np.uint8], rise: npt.NDArray[np.int64], fall: npt.NDArray[np.int64]
    ) -> Pulses:
        return Pulses(pin, rise, fall - rise, rise > self.begin)


def _first_of_pin(pin: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """Return which of the edges, sorted by pin, are the first of their pin."""
    return np.append(True, pin[1:] != pin[:-1])[: len(pin)]


def pulses(trace: EdgeTrace) -> Pulses:
    """Return all pulses of a trace; those that its end cuts off come last."""
    reader = PulseReader()
    return joined([*map(reader, trace.chunks), reader.cut(int(trace.end))])


def joined(parts: list[Pulses]) -> Pulses:
    """Return consecutive pulses as one."""
    return Pulses(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
