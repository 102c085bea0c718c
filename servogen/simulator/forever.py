"""Proof for all time: a machine that comes back to a state that it was in before does the same again, for
ever.

In: an image, a clock, and how to tell where a frame starts. Out: a `Repeat` (lead-in and loop), or a
`NoRepeat` that says why not and how much time was covered. The states of two frame starts are compared byte
for byte, by Brent's method, which keeps one of them in memory however long the search takes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from servogen.edges import HIGH
from servogen.pic.image import Image
from servogen.simulator.machine import Machine
from servogen.simulator.options import Options
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True)
class Repeat:
    """From `lead_in` on (counted from reset) the machine does the same every `loop` cycles, for ever."""

    lead_in: Cycles
    loop: Cycles
    lead_in_frames: int
    loop_frames: int


@dataclass(frozen=True, slots=True)
class NoRepeat:
    """No proof: the reason, and the time from reset that was looked at."""

    reason: str
    covered: Cycles


Start = Callable[[Machine], Cycles | None]
"""Takes a machine to its next frame start and says the cycle, or None when there is none in reach."""


def find_repeat(
    image: Image,
    clock: Clock,
    *,
    pin: int,
    limit: int,
    period: int | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> Repeat | NoRepeat:
    """The first repeat of the machine's complete state at a frame start, within `limit` cycles from reset.

    The first frame starts with the first rising edge of `pin` (its index in `PINS`); the others every
    `period` cycles after it, or without a period at every rising edge of that pin. There is no stimulus: it
    would have to repeat too.
    """

    def walk() -> _Walk:
        return _Walk(Machine(image, clock, options), pin, limit, period)

    hare = walk()
    if not hare.step():
        return NoRepeat("the pin never rises", hare.machine.cycles)
    tortoise = hare.state()
    power = loop_frames = 1
    while True:
        if not hare.step():
            reason = "no state was found that repeats" if hare.frames > 1 else "the pin rises only once"
            return NoRepeat(reason, hare.machine.cycles)
        if unwritten := hare.machine.read_unwritten:
            names = ", ".join(f"0x{address:02X}" for address in unwritten)
            reason = f"RAM was read that was never written, at {names}: what it holds at power-up is unknown"
            return NoRepeat(reason, hare.machine.cycles)
        if hare.state() == tortoise:
            break
        if power == loop_frames:
            tortoise = hare.state()
            power *= 2
            loop_frames = 0
        loop_frames += 1
    return _first(walk, loop_frames)


def _first(walk: Callable[[], _Walk], loop_frames: int) -> Repeat:
    """Where the loop of known length begins: two walks, one loop apart, until they agree."""
    behind, ahead = walk(), walk()
    for _ in range(loop_frames):
        ahead.step()
    while True:
        behind.step()
        ahead.step()
        if behind.state() == ahead.state():
            lead_in, end = behind.at, ahead.at
            return Repeat(lead_in, Cycles(end - lead_in), behind.frames - 1, loop_frames)


class _Walk:
    """A machine that goes from frame start to frame start."""

    def __init__(self, machine: Machine, pin: int, limit: int, period: int | None) -> None:
        self.machine = machine
        self.frames = 0
        """Frame starts seen."""
        self.at = Cycles(0)
        """The cycle of the last one."""
        self._pin, self._limit, self._period = pin, limit, period

    def step(self) -> bool:
        """On to the next frame start; False when it is not within the limit."""
        if self._period is None or self.frames == 0:
            left = self._limit - self.machine.cycles
            edge = self.machine.run_to_edge(self._pin, HIGH, max(left, 0))
            if edge is None:
                return False
            self.at = edge
        else:
            self.at = Cycles(self.at + self._period)
            if self.at > self._limit:
                return False
            self.machine.run_until(cycle=self.at + 1)
        self.frames += 1
        return True

    def state(self) -> tuple[int, bytes]:
        """The machine's state, and by how many cycles an instruction went past the frame start."""
        return self.machine.cycles - self.at, self.machine.fingerprint()
