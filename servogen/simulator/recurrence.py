"""Unlimited time: a machine that returns to an earlier state repeats its behaviour from then on.

In: an image, a clock, and a definition of where a frame starts. Out: a `Repeat` (lead-in and loop), or a
`NoRepeat` with the reason and the time covered. For each frame start, a digest of 16 bytes of everything that
the machine's future depends on is kept; two equal digests are then verified byte by byte.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import blake2b

from servogen.edges import HIGH, PINS
from servogen.pic.image import Image
from servogen.simulator.machine import Machine, Stimulus
from servogen.simulator.options import SimulatorOptions
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True)
class Repeat:
    """From `lead_in` on (counted from reset) the machine repeats the same behaviour every `loop` cycles
    without end.
    """

    lead_in: Cycles
    loop: Cycles
    lead_in_frames: int
    loop_frames: int


@dataclass(frozen=True, slots=True)
class NoRepeat:
    """No repetition: the reason, and the time from reset that was examined."""

    reason: str
    covered: Cycles


def find_repeat(
    image: Image,
    clock: Clock,
    *,
    pin: int,
    limit: int,
    period: int | None = None,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    stimulus: Stimulus | None = None,
) -> Repeat | NoRepeat:
    """Return the first repetition of the machine's complete state at a frame start, within `limit` cycles
    from reset.

    The first frame starts with the first rising edge of `pin` (its index in `PINS`); the others every
    `period` cycles after it or, without a period, at every rising edge of that pin. A stimulus must make its
    last change before the first frame, because later changes would have to repeat too.
    """

    walk = _Walk(Machine(image, clock, options, stimulus, tracked=True), pin, limit, period)
    seen: dict[bytes, int] = {}
    while True:
        if not walk.step():
            few = (f"{PINS[pin]} never rises", f"{PINS[pin]} rises only once")
            reason = few[walk.frames] if walk.frames < len(few) else "no state was found that repeats"
            return NoRepeat(reason, walk.machine.cycles)
        dependent = walk.machine.chip_dependent
        if dependent:
            return NoRepeat(f"other chips may make other edges: {dependent[0].sentence}", walk.machine.cycles)
        digest = blake2b(walk.state(), digest_size=16).digest()
        first = seen.setdefault(digest, walk.frames)
        if first == walk.frames:
            continue
        # Two digests may be equal by chance: the machine is run again to the first of the two moments, and
        # the states are compared in full.
        before = _Walk(Machine(image, clock, options, stimulus, tracked=True), pin, limit, period)
        for _ in range(first):
            before.step()
        if before.state() == walk.state():
            return Repeat(before.at, Cycles(walk.at - before.at), first - 1, walk.frames - first)


class _Walk:
    """A machine that is advanced from frame start to frame start."""

    def __init__(self, machine: Machine, pin: int, limit: int, period: int | None) -> None:
        self.machine = machine
        self.frames = 0
        """Frame starts seen."""
        self.at = Cycles(0)
        """The cycle of the last one."""
        self._pin, self._limit, self._period = pin, limit, period

    def step(self) -> bool:
        """Advance to the next frame start; return False if it is not within the limit."""
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

    def state(self) -> bytes:
        """Return the machine's state, its unknown bits, and its distance from the frame start."""
        past = self.machine.cycles - self.at
        return past.to_bytes(8, "little") + self.machine.fingerprint() + self.machine.unknown()
