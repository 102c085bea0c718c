"""`SerialLine`: the serial line into the virtual chip, from a pseudo-terminal to one of its pins.

In: bytes of a client. Out: start bit, eight bits (lowest first), stop bit on the pin, byte after byte at the
baud rate. The chip's time goes on while there are bytes to send; in real time it goes on for itself.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from servogen.bench.virtual.chip import VirtualChip
from servogen.edges import HIGH, LOW
from servogen.simulator.layout import PACK_CYCLE, PACK_PIN
from servogen.simulator.sources import whole
from servogen.units import Clock

BITS = 10
"""Start bit, eight of data, stop bit."""


@dataclass(slots=True)
class LineStimulus:
    """What comes over the line, as the simulator takes it: a byte at a time, as long as there are any."""

    pin: int
    baud: int
    inverted: bool = False
    waiting: deque[int] = field(default_factory=deque)

    def changes(self, clock: Clock) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        bit = clock.cycles_per_second / self.baud
        idle = LOW if self.inverted else HIGH
        until = Fraction(1)
        yield whole(until), self._packed([(0, idle)])
        while True:
            changes = []
            if self.waiting:
                byte = self.waiting.popleft()
                bits = [0, *(byte >> n & 1 for n in range(8)), 1]
                changes = [
                    (whole(until + n * bit), idle if value else HIGH + LOW - idle)
                    for n, value in enumerate(bits)
                ]
            until += BITS * bit
            yield whole(until), self._packed(changes)

    def _packed(self, changes: list[tuple[int, int]]) -> npt.NDArray[np.int64]:
        return np.array(
            [cycle << PACK_CYCLE | self.pin << PACK_PIN | level for cycle, level in changes], dtype=np.int64
        )


@dataclass(slots=True)
class SerialLine:
    """The client's end: takes bytes, and lets the chip run while they are sent."""

    chip: VirtualChip
    stimulus: LineStimulus
    outgoing: bytearray = field(default_factory=bytearray)
    gone: bool = False

    @property
    def working(self) -> bool:
        return bool(self.stimulus.waiting) or self.chip.in_real_time

    def received(self, data: bytes) -> None:
        self.stimulus.waiting.extend(data)

    def work(self) -> None:
        """Lets a byte's time pass, or as much as has passed."""
        byte = int(BITS * self.chip.clock.cycles_per_second / self.stimulus.baud) + 1
        self.chip.run(self.chip.due(byte))
