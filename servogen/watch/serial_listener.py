"""`SerialListener`: the bytes that a chip sends on a pin, as they come.

In: edges of a run, in order. Out: the bytes of a line that idles high, of a start bit, eight bits (the lowest
first) and a stop bit; a byte without its stop bit is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from servogen.edges import HIGH, LOW, PINS, EdgeChunk
from servogen.units import Clock

BITS = 8
MAX_WAITING = 4096
"""The maximum number of bytes that wait to be taken; the oldest ones are dropped."""


class SerialListener:
    """Decodes one pin at one baud rate."""

    def __init__(self, pin: int, baud: Fraction, clock: Clock) -> None:
        self._pin = pin
        self._baud = baud
        self._bit = clock.cycles_per_second / baud
        self._bytes: list[int] = []
        self.restart(0, ())

    @property
    def model(self) -> dict[str, object]:
        return {"pin": PINS[self._pin], "baud": int(self._baud)}

    def restart(self, now: int, levels: Sequence[int]) -> None:
        """Begin anew at a moment, before which the pins had these levels."""
        self._level = levels[self._pin] if levels else LOW
        self._start: Fraction | None = None
        self._value = self._taken = 0
        self._now = now

    def add(self, edges: EdgeChunk, now: int) -> None:
        """Take the edges up to `now`."""
        mine = np.flatnonzero(edges.pin == self._pin)
        for cycle, level in zip(edges.cycle[mine].tolist(), edges.level[mine].tolist(), strict=True):
            self._sample(cycle)
            if self._start is None and self._level == HIGH and level == LOW:
                self._start, self._value, self._taken = Fraction(cycle), 0, 0
            self._level = level
        self._sample(now)

    def taken(self) -> list[int]:
        """Return the bytes since the last time."""
        received, self._bytes = self._bytes[-MAX_WAITING:], []
        return received

    def _sample(self, until: int) -> None:
        """Take the bits whose middle lies before `until`: until then the level has not changed."""
        while self._start is not None:
            middle = self._start + (Fraction(3, 2) + self._taken) * self._bit
            if middle >= until:
                return
            if self._taken < BITS:
                self._value |= (self._level == HIGH) << self._taken
                self._taken += 1
            else:
                if self._level == HIGH:
                    self._bytes.append(self._value)
                self._start = None
