"""`VirtualChip`: the simulated chip on the bench, with a crystal that is as wrong as real ones are.

In: an image; time, as microseconds of the bench's own clock. Out: edges at true times. Programming it stops
it; `reset` starts it with what is on it then.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS, EdgeChunk
from servogen.pic.image import Image
from servogen.simulator import Machine, Options, Stimulus
from servogen.simulator.native import loop
from servogen.units import Clock

MILLION = 10**6


@dataclass(slots=True)
class VirtualChip:
    """The chip runs `ppm` millionths faster than its nominal clock."""

    image: Image
    clock: Clock
    options: Options = field(default_factory=Options)
    ppm: Fraction = Fraction(0)
    stimulus: Stimulus | None = None
    machine: Machine = field(init=False)
    word: int = field(init=False)
    """The levels of the pins at the present cycle, pin n of `PINS` in bit n."""

    def __post_init__(self) -> None:
        loop(observed=False)  # compiled now, not while a client waits
        self.load(self.image)

    def load(self, image: Image) -> None:
        """Another image on the chip, and a reset."""
        self.image = image
        self.machine = Machine(image, self.clock, self.options, self.stimulus)
        self.word = 0

    @property
    def cycles_per_second(self) -> Fraction:
        """By a true clock."""
        return self.clock.cycles_per_second * (1 + self.ppm / MILLION)

    def run(self, cycles: int) -> Iterator[EdgeChunk]:
        """Runs on, giving the edges with an undriven pin as low, as an analyser with pull-downs sees it."""
        for chunk in self.machine.stream(cycles):
            for pin in range(len(PINS)):
                levels = chunk.level[chunk.pin == pin]
                if len(levels):
                    high = levels[-1] == HIGH
                    self.word = self.word & ~(1 << pin) | int(high) << pin
            yield chunk

    def words(self, cycles: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint32]]:
        """Runs on: the cycles at which levels change, and the levels of all pins from each of them on.

        The first entry is the present cycle.
        """
        before, now = self.word, self.machine.cycles
        chunks = list(self.run(cycles))
        cycle = np.concatenate([np.array([now], dtype=np.int64), *(chunk.cycle for chunk in chunks)])
        level = np.full(len(cycle), before, dtype=np.uint32)
        pins = np.concatenate([np.zeros(0, dtype=np.uint8), *(chunk.pin for chunk in chunks)])
        highs = np.concatenate([np.zeros(0, dtype=bool), *(chunk.level == HIGH for chunk in chunks)])
        for pin in range(len(PINS)):
            bit = np.uint32(1 << pin)
            own = np.flatnonzero(pins == pin)
            marks = np.zeros(len(cycle), dtype=np.int64)
            marks[own + 1] = own + 1
            last = np.maximum.accumulate(marks)
            value = np.concatenate([[bool(before >> pin & 1)], highs])[last]
            level = np.where(value, level | bit, level & ~bit).astype(np.uint32)
        last_of_cycle = np.append(cycle[1:] != cycle[:-1], True)
        return cycle[last_of_cycle], level[last_of_cycle]
