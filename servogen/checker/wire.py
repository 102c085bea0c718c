"""The wire of another chip, as the checker follows what a program reads of it: "Two chips" in docs/proof.md.

In: levels, each with the cycle in which it is read. Out: what is remembered of them, and where the frames
begin or end. Whatever the wire does, the pulses of a frame are due if, and only if, the program has looked at
it in the cycle before its rise and in the two after, and it was low, high and high. Where it is quiet and
then rises once a frame, the first of them are due in one certain frame.

Where the wire is of a chip with another crystal, a frame is due from the read on that finds it high, one of
the looks that begin `early` cycles before a frame has passed since the last such read, all others low.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

Memory = tuple[int, ...]
HIGH, QUIET, READY, JOINING, PLAYING = range(5)
"""What was read last: high; low, since the time 0; low for long enough, last at the time 0; a rise, at the
time 0; or pulses are due.
"""
AROUND = 8
"""For so many cycles before a rise a regular wire is low, and for as many from it on it is high."""
LEVELS = 0, 1, 1


class WireStep(NamedTuple):
    """What a read leads to."""

    memory: Memory
    restarts: bool = False
    """Whether the time is 0 from this read on, and no pulse is due."""
    begins: bool = False
    """Whether the pulses of the first frame are due."""


@dataclass(frozen=True)
class WireReads:
    """The memory is what was read last; while joining, the least and the most cycles by which the rise was
    seen late, (1, 0) if the wire is not regular; the time of the latest read; and how many reads of a look
    were made in cycles on end, and whether all were as they have to be.
    """

    pin: int
    period: int
    frames: int
    """The number of the rise after which the first pulses are due, from 0."""
    quiet: int
    """The cycles from the first low level to those that count as quiet."""
    look: int
    """The time in a frame in which the look at the next rise begins."""
    restart: int = 0
    """The pin, as a word, that is wired to the other chip's MCLR,"""
    pulled: int = 0
    """and for how many cycles it is low, once, before the first read."""
    early: int = 0
    """With two crystals, by how much the looks begin before a frame has passed, an even number."""
    at_once: ClassVar[bool] = True
    power_up: ClassVar[Memory] = (HIGH, 1, 0, 0, 0, 1)
    plays: ClassVar[Memory] = (PLAYING, 1, 0, 0, 0, 1)

    def hear(self, memory: Memory, levels: int) -> Memory:
        """Return the memory after a frame: what was read is in it already."""
        return memory

    def looks(self, memory: Memory, level: int, time: int) -> WireStep | None:
        """Return what a read at `time` of a frame with pulses leads to; None if it is not one of the look."""
        if self.early:
            return self._rises(memory, level, time - self.look)
        *others, seen, good = memory
        if time != self.look + seen:
            return None
        good = int(good and level == LEVELS[seen])
        if seen == 2 and not good:
            return WireStep(self.power_up, restarts=True)
        return WireStep((*others, seen + 1, good))

    def awaits(self, memory: Memory, level: int, time: int) -> WireStep:
        """Return what a read leads to while no pulse is due. Raises ValueError with what is wrong."""
        kind = memory[0]
        if kind == JOINING and self.early:
            if time > self.period + self.early:
                raise ValueError("the wire's rise is not looked at in time")
            return self._rises(memory, level, time - self.period + self.early) or WireStep(memory)
        if kind == JOINING:
            return self._joins(memory, level, time)
        if time > self.period + (self.quiet if kind == QUIET else 0):
            raise ValueError("the wire is not looked at for a frame")
        if kind in (QUIET, READY) and time - memory[3] > self.period // 60:
            raise ValueError("the quiet wire is looked at too seldom")
        if kind == READY and level and self.early and time > 4:
            raise ValueError("the first rise is awaited too seldom")
        if kind == READY:
            return self._from(JOINING, 0, time - 1) if level else self._from(READY)
        if kind == QUIET and time >= self.quiet:
            return self._from(JOINING if level else READY)
        if kind == QUIET and not level:
            return WireStep((*memory[:3], time, *memory[4:]))
        return self._from(HIGH if level else QUIET)

    def _from(self, kind: int, least: int = 1, most: int = 0) -> WireStep:
        return WireStep((kind, least, most, 0, 0, 1), restarts=True)

    def _rises(self, memory: Memory, level: int, since: int) -> WireStep | None:
        """Return what a read leads to so many cycles after the first look at a rise; None if it is none."""
        *others, seen, good = memory
        if since != 2 * seen:
            return None
        if level == 0:
            return self._from(HIGH) if since == 2 * self.early else WireStep((*others, seen + 1, good))
        return WireStep(self.plays, begins=True) if seen else self._from(HIGH)

    def _joins(self, memory: Memory, level: int, time: int) -> WireStep:
        _, least, most, last, seen, good = memory
        due = self.frames * self.period + 1  # from the rise to the last read of the look
        if time > due or most > self.period or least < 0:
            raise ValueError("the wire's rise is not looked at in time")
        late = [each for each in range(least, most + 1) if level in self._possible(time + each)]
        least, most = (min(late), max(late)) if late else (1, 0)
        if not (seen and time == last + 1):
            seen, good = 0, 1
        good = int(good and level == LEVELS[seen])
        if seen < 2:
            return WireStep((JOINING, least, most, time, seen + 1, good))
        if late and not (good and least == most == due - time):
            raise ValueError("the wire is looked at in another cycle than that of its rise")
        return WireStep(self.plays, begins=True) if good else self._from(HIGH)

    def _possible(self, since: int) -> tuple[int, ...]:
        """Return the levels of a regular wire so many cycles after its first rise."""
        cycle = since % self.period
        return (1,) if cycle < AROUND else (0,) if cycle >= self.period - AROUND else (0, 1)
