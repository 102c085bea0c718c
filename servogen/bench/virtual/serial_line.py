"""`SerialLine`: the serial line to the virtual chip, from a pseudo-terminal to its pins and back.

In: bytes of a client. Out: start bit, eight bits (lowest first), stop bit on the chip's pin, byte after byte
at the baud rate; and what the chip sends, as bytes to the client. The chip runs while there are bytes to
send, and a moment longer for its answer; in real time it runs by itself.

    idle ───┐     ┌─────┐  …  ┌──────  idle        a bit is sampled in its middle
            └─────┘  0  └─────┘  stop
             start  │  1
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from servogen.bench.virtual.chip import Levels, VirtualChip
from servogen.edges import HIGH, LOW
from servogen.simulator.layout import PACK_CYCLE, PACK_PIN
from servogen.simulator.sources import whole
from servogen.units import Clock

BITS = 10
"""Start bit, eight of data, stop bit."""

ANSWER_S = Fraction(1, 2)
"""The time that the chip may take to answer; then it stops again."""

MAX_WAITING_BYTES = 1 << 16
"""The bytes kept for a client; older ones are lost, as on a real line."""


@dataclass(slots=True)
class LineStimulus:
    """The line as a stimulus of the simulator: one byte at a time, as long as there are any.

    `held` has the levels of pins that the board holds, by their numbers.
    """

    pin: int
    baud: int
    inverted: bool = False
    held: Mapping[int, int] = field(default_factory=dict)
    waiting: deque[int] = field(default_factory=deque)

    @property
    def idle(self) -> int:
        return LOW if self.inverted else HIGH

    def changes(self, clock: Clock) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        bit = clock.cycles_per_second / self.baud
        until = Fraction(1)
        at_begin = {**self.held, self.pin: self.idle}
        yield whole(until), _packed_levels((0, pin, level) for pin, level in at_begin.items())
        while True:
            changes = []
            if self.waiting:
                byte = self.waiting.popleft()
                bits = [0, *(byte >> n & 1 for n in range(8)), 1]
                changes = [
                    (whole(until + n * bit), self.pin, self.idle if value else HIGH + LOW - self.idle)
                    for n, value in enumerate(bits)
                ]
            until += BITS * bit
            yield whole(until), _packed_levels(changes)


def _packed_levels(changes: Iterable[tuple[int, int, int]]) -> npt.NDArray[np.int64]:
    """Return (cycle, pin, level) of each change, packed for the instruction loop."""
    return np.array(
        [cycle << PACK_CYCLE | pin << PACK_PIN | level for cycle, pin, level in changes], dtype=np.int64
    )


@dataclass(slots=True)
class LineReceiver:
    """Decodes what the chip sends on `pin` from its edges; a byte with a wrong stop bit is omitted."""

    pin: int
    bit: Fraction
    """Cycles."""
    inverted: bool = False
    _high: bool = False
    """Whether the line is at its idle level; before the chip drives it, it is not."""
    _start: int | None = None
    """The cycle of the start bit's edge, while a byte is under way."""
    _edges: list[int] = field(default_factory=list)
    """The edges since then."""

    def add(self, levels: Levels, until: int) -> bytes:
        """Process the pins' changes up to cycle `until`, and return the bytes that ended in it."""
        received = bytearray()
        cycle, word = levels
        line = (word >> np.uint32(self.pin) & np.uint32(1)).astype(bool) != self.inverted
        changed = np.flatnonzero(np.append(line[:1] != self._high, line[1:] != line[:-1]))
        for edge in cycle[changed].tolist():
            received += self._complete_byte(edge)
            if self._start is not None:
                self._edges.append(edge)
            elif self._high:
                self._start = edge
            self._high = not self._high
        return bytes(received + self._complete_byte(until))

    def _complete_byte(self, now: int) -> bytes:
        """Return the current byte once its stop bit has been sampled."""
        if self._start is None or now < self._start + (BITS - Fraction(1, 2)) * self.bit:
            return b""
        middles = [self._start + (n + Fraction(1, 2)) * self.bit for n in range(BITS)]
        # The line is low after the start bit's edge; an odd number of edges since then makes it high.
        bits = [sum(edge <= middle for edge in self._edges) % 2 for middle in middles]
        self._start, self._edges = None, []
        start, *data, stop = bits
        good = not start and stop
        return bytes([sum(bit << n for n, bit in enumerate(data))]) if good else b""


@dataclass(slots=True)
class SerialLine:
    """The client's end: takes bytes, returns what the chip sends, and runs the chip meanwhile."""

    chip: VirtualChip
    stimulus: LineStimulus
    receiver: LineReceiver | None = None
    outgoing: bytearray = field(default_factory=bytearray)
    gone: bool = False
    reset: bool = False
    _until: int = 0
    """The cycle up to which the chip runs for the client."""

    def __post_init__(self) -> None:
        self.chip.listeners.append(self._heard)

    @property
    def working(self) -> bool:
        return self.chip.in_real_time or bool(self.stimulus.waiting) or self.chip.now < self._until

    def received(self, data: bytes) -> None:
        self.stimulus.waiting.extend(data)
        line = Fraction(BITS * len(self.stimulus.waiting), self.stimulus.baud)
        self._until = self.chip.now + int((line + ANSWER_S) * self.chip.clock.cycles_per_second)

    def work(self) -> None:
        """Run the chip for the time of one byte, or for as much as has passed."""
        byte = int(BITS * self.chip.clock.cycles_per_second / self.stimulus.baud) + 1
        self.chip.run(self.chip.due(byte))

    def _heard(self, levels: Levels, until: int) -> None:
        if self.receiver is not None:
            self.outgoing += self.receiver.add(levels, until)
            del self.outgoing[:-MAX_WAITING_BYTES]
