"""The stream engine's frame: one slot for each servo, all with the same number of rounds of TMR0.

In: the servos and the requested frame. Out: `RoundLayout`; InputError if the pulses do not fit.

    |<------- slot: whole rounds of 256 cycles ------->|
    |    ▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁|
      rise: TMR0 = 152             fall, at least 80 before the next slot's round
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from servogen.engines.stream.protocol import BITS, BYTES, FINE_SERVOS, MAX_TRIM, WidthRange, travel
from servogen.engines.stream.settings import BAUD_ERROR
from servogen.errors import InputError
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

ROUND = 256
RISE = 152
"""TMR0 when a pulse begins."""
LATEST = 80
"""The latest fall, in cycles after TMR0 = RISE in the penultimate round of its slot."""
MIN_WIDTH = Cycles(ROUND + MAX_TRIM + 1)
REACTION_S = Fraction(10, 1000)
"""The time after which a command takes effect in the next frame; two slots may pass before its pulse."""
C_ROUNDS = 9
"""The rounds reserved for the C to prepare a pulse and execute a command."""
MAX_SLOTS = 60


@dataclass(frozen=True, slots=True)
class RoundLayout:
    """`slots` of `rounds` timer rounds each; servo n's pulse is in slot n, the others are silent."""

    slots: int
    rounds: int

    @property
    def period(self) -> Cycles:
        """Return the frame's length in cycles."""
        return Cycles(self.slots * self.rounds * ROUND)

    def rise(self, servo: int) -> Cycles:
        """Return the cycles from the first servo's rise to this servo's."""
        return Cycles(servo * self.rounds * ROUND)


def is_coarse(servos: Sequence[Servo]) -> bool:
    """Return whether the RAM holds a byte of each servo's place and goal, not two: see docs/firmware.md."""
    ports = {servo.pin[1] for servo in servos}
    return len(servos) > FINE_SERVOS + 1 - len(ports)


def layout(servos: Sequence[Servo], frame: Frame, clock: Clock, baud: int) -> RoundLayout:
    """Return the longest frame that does not exceed the requested one. Raises InputError."""
    widths = [travel(servo, clock) for servo in servos]
    for servo, width in zip(servos, widths, strict=True):
        if width.minimum < MIN_WIDTH:
            raise InputError(
                "pulse-too-short",
                f"{servo.name}: a pulse of {width.minimum} cycles is shorter than {MIN_WIDTH}",
                servo.place,
                "use a faster clock, or narrow the servo's limits",
            )
    rounds = frame.period.cycles // ROUND
    minimum = max(C_ROUNDS, _rounds(widths, 0 if is_coarse(servos) else MAX_TRIM))
    maximum = _max_rounds(clock, baud)
    if minimum > maximum:
        raise InputError(
            "baud-rate",
            f"the longest pulse needs a slot of {minimum} rounds of {ROUND} cycles; "
            f"commands at {baud} baud come after as few as {maximum}",
            frame.place,
            "use a lower rate, or narrow the servos' limits",
        )
    fits = [
        RoundLayout(slots, min(rounds // slots, maximum))
        for slots in range(len(servos), MAX_SLOTS)
        if rounds // slots >= minimum
    ]
    if not fits:
        raise InputError(
            "frame-too-short",
            f"the pulses do not fit a frame: {len(servos)} servos, one after the other, take {minimum} "
            f"rounds of {ROUND} cycles each, the frame has {rounds}",
            frame.place,
            f"period_us = {float(clock.us(len(servos) * minimum * ROUND)):g}, or narrow the servos' limits",
        )
    return max(fits, key=lambda candidate: (candidate.period, -candidate.slots))


def _max_rounds(clock: Clock, baud: int) -> int:
    """Return the longest slot in rounds for which commands are executed in time and take effect soon
    enough.
    """
    command = clock.cycles_per_second / baud * BITS * BYTES * (1 - BAUD_ERROR)
    soon = clock.cycles_per_second * REACTION_S / 2
    return int(min(command - C_ROUNDS * ROUND, soon) // ROUND)


def _rounds(widths: Sequence[WidthRange], trim: int) -> int:
    """Return the rounds of the shortest slot that holds the longest pulse and its trim."""
    longest = max(width.maximum for width in widths) + trim
    return -(-(longest - LATEST) // ROUND) + 1
