"""`VirtualChip`: the simulated chip on the bench, with a crystal that deviates as real ones do.

In: an image; time, in microseconds of the bench's own clock. Out: edges at true times. Programming stops the
chip; `load` starts it with its new contents.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS
from servogen.pic.image import Image
from servogen.simulator import Machine, Options, Stimulus
from servogen.simulator.aot_cache import loop
from servogen.units import Clock

Levels = tuple[npt.NDArray[np.int64], npt.NDArray[np.uint32]]
"""Non-decreasing cycles, and the levels of all pins from each of them on."""

MILLION = 10**6
MOMENT_S = 0.002


@dataclass(slots=True)
class VirtualChip:
    """The chip runs `ppm` millionths faster than its nominal clock."""

    image: Image
    clock: Clock
    options: Options = field(default_factory=Options)
    ppm: Fraction = Fraction(0)
    stimulus: Stimulus | None = None
    in_real_time: bool = False
    """Whether its time is real time; otherwise it passes only while somebody captures or sends."""
    machine: Machine = field(init=False)
    word: int = field(init=False)
    """The levels of the pins at the present cycle, pin n of `PINS` in bit n."""
    listeners: list[Callable[[Levels, int], None]] = field(default_factory=list)
    """Called with the pins' levels whenever the chip has run, and the cycle up to which it ran."""
    watched: bool = False
    """Whether the levels of runs by others are kept for `look`."""
    _before: int = 0
    """The cycles that it ran before its last reset."""
    _reset_at: float = 0.0
    _seen: list[Levels] = field(default_factory=list)

    def __post_init__(self) -> None:
        loop(observed=False, tracked=False)  # compiled now, not while a client waits
        self.load(self.image)

    def load(self, image: Image) -> None:
        """Load another image and reset the chip; its pins are low until it drives them."""
        self._before += self.machine.cycles if self._reset_at else 0
        self.image = image
        self.machine = Machine(image, self.clock, self.options, self.stimulus)
        self._reset_at = time.monotonic()
        self.word = 0
        if self.watched:
            self._seen.append((np.array([self.now], dtype=np.int64), np.zeros(1, dtype=np.uint32)))

    @property
    def now(self) -> int:
        """Return the cycles since creation, which a reset does not set back."""
        return self._before + self.machine.cycles

    def due(self, most: int) -> int:
        """Return how many of `most` cycles may run now, after a short wait if the clock requires it."""
        if not self.in_real_time:
            return most
        reached = int(Fraction(time.monotonic() - self._reset_at) * self.cycles_per_second)
        if reached <= self.machine.cycles:
            time.sleep(MOMENT_S)
        return max(0, min(most, reached - self.machine.cycles))

    @property
    def cycles_per_second(self) -> Fraction:
        """Return the cycles per second of a true clock."""
        return self.clock.cycles_per_second * (1 + self.ppm / MILLION)

    def run(self, cycles: int) -> None:
        """Run the chip for `cycles`."""
        levels = self._levels(cycles)
        if self.watched:
            self._seen.append(levels)

    def forget(self) -> None:
        """Drop the levels that were kept for `look`."""
        self._seen.clear()

    def look(self, cycles: int) -> Levels:
        """Run the chip and return the levels since the last look; the first entry is the level at its
        beginning.
        """
        pieces = [*self._seen, self._levels(cycles)]
        self._seen.clear()
        cycle, level = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        last_of_cycle = np.append(cycle[1:] != cycle[:-1], True)
        return cycle[last_of_cycle], level[last_of_cycle]

    def _levels(self, cycles: int) -> Levels:
        """Run the chip and return the current cycle, those at which levels change, and the levels from each
        on.

        A pin that nothing drives is low, as an analyser's input with a pull-down sees it.
        """
        word, now, before = self.word, self.now, self._before
        chunks = list(self.machine.stream(cycles))
        pins = np.concatenate([np.zeros(0, dtype=np.uint8), *(chunk.pin for chunk in chunks)])
        highs = np.concatenate([np.zeros(0, dtype=bool), *(chunk.level == HIGH for chunk in chunks)])
        cycle = np.concatenate([np.array([now], dtype=np.int64), *(chunk.cycle + before for chunk in chunks)])
        level = np.zeros(len(cycle), dtype=np.uint32)
        for pin in range(len(PINS)):
            own = np.flatnonzero(pins == pin)
            changes = np.zeros(len(cycle), dtype=np.int64)
            changes[own + 1] = own + 1
            last = np.maximum.accumulate(changes)
            value = np.concatenate([[bool(word >> pin & 1)], highs])[last]
            level |= value.astype(np.uint32) << np.uint32(pin)
        self.word = int(level[-1])
        for listener in self.listeners:
            listener((cycle, level), self.now)
        return cycle, level
