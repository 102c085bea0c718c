"""Sensors of the robot -> levels of the chip's input pins, in lock-step with the physics.

In: the job's sensors and the state of the physics. Out: `Feed`, a stimulus of the simulated chip that knows
the levels up to the moment that the physics has reached.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from heapq import merge

import numpy as np
import numpy.typing as npt

from servogen.simulator import LevelChange, Stimuli
from servogen.simulator.layout import NEVER, PACK_CYCLE, PACK_PIN
from servogen.units import Clock

Packed = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Sensor:
    """An input pin, by its number: at the level `active` while `reads` returns True, else at the other."""

    pin: int
    active: int
    reads: Callable[[], bool]
    text: str


class Feed:
    """Changes of input pins, pushed as the physics goes; scripted ones, such as buttons, are merged in."""

    def __init__(self, scripted: Stimuli | None, clock: Clock) -> None:
        sources = scripted.sources if scripted else ()
        self._scripted = merge(
            *(source.changes(clock) for source in sources), key=lambda change: change.cycle
        )
        self._ahead = next(self._scripted, None)
        self._pushed: deque[LevelChange] = deque()
        self._known = 0
        self._levels: dict[int, int] = {}
        self.seen: list[LevelChange] = []
        """All changes of sensors so far."""

    def push(self, cycle: int, pin: int, level: int) -> None:
        """Drive a pin from a cycle on; a level that it already has is dropped."""
        if self._levels.get(pin) != level:
            self._levels[pin] = level
            change = LevelChange(cycle, pin, level)
            self._pushed.append(change)
            self.seen.append(change)

    def know(self, cycle: int) -> None:
        """Declare that every change before a cycle has been pushed."""
        self._known = cycle

    def changes(self, clock: Clock) -> Iterator[tuple[int, Packed]]:
        """Yield what is known, piece by piece; the chip never runs beyond it."""
        while True:
            piece = [self._pushed.popleft() for _ in range(len(self._pushed))]
            while self._ahead is not None and self._ahead.cycle < self._known:
                piece.append(self._ahead)
                self._ahead = next(self._scripted, None)
            piece.sort(key=lambda change: change.cycle)
            packed = [change.cycle << PACK_CYCLE | change.pin << PACK_PIN | change.level for change in piece]
            yield min(self._known, NEVER), np.array(packed, dtype=np.int64)
