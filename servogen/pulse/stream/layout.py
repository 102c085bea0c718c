"""The stream engine's frame: a slot for each servo, one after the other, all of as many rounds of TMR0.

In: the servos and the frame asked for. Out: `Layout`; InputError where the pulses do not fit.

    |<------- slot: whole rounds of 256 cycles ------->|
    |    ▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁|
      rise: TMR0 = 176             fall, at least 80 before the next slot's round
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from servogen.errors import InputError
from servogen.pulse.slots import Frame
from servogen.pulse.stream.protocol import MOST_TRIM, Travel, travel
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

ROUND = 256
RISE = 176
"""TMR0 when a pulse begins."""
LATEST = 96
"""A fall may be so many cycles after TMR0 = RISE in the last round of its slot but one."""
LEAST_WIDTH = Cycles(ROUND + MOST_TRIM + 1)
MOST_ROUNDS = 200
"""Of a slot, counted in a byte."""


@dataclass(frozen=True, slots=True)
class Layout:
    """`slots` of `rounds` timer rounds each; servo n's pulse is in slot n, the others are silent."""

    slots: int
    rounds: int

    @property
    def period(self) -> Cycles:
        return Cycles(self.slots * self.rounds * ROUND)

    def rise(self, servo: int) -> Cycles:
        """From the first servo's rise."""
        return Cycles(servo * self.rounds * ROUND)


def layout(servos: Sequence[Servo], frame: Frame, clock: Clock) -> Layout:
    """The frame nearest to the one asked for that is no longer. Raises InputError."""
    widths = [travel(servo, clock) for servo in servos]
    for servo, each in zip(servos, widths, strict=True):
        if each.least < LEAST_WIDTH:
            raise InputError(
                f"{servo.name}: a pulse of {each.least} cycles is shorter than {LEAST_WIDTH}",
                servo.place,
                "take a faster clock, or narrow the servo's limits",
            )
    rounds = frame.period.cycles // ROUND
    slots = max(len(servos), -(-rounds // MOST_ROUNDS))
    made = Layout(slots, rounds // slots)
    least = _rounds(widths)
    if made.rounds < least:
        raise InputError(
            f"the pulses do not fit a frame: {len(servos)} servos, one after the other, take {least} rounds "
            f"of {ROUND} cycles each, the frame has {made.rounds}",
            frame.place,
            f"period_us = {float(clock.us(len(servos) * least * ROUND)):g}, or narrow the servos' limits",
        )
    return made


def _rounds(widths: Sequence[Travel]) -> int:
    """Of the shortest slot that holds the longest pulse and its trim."""
    longest = max(each.most for each in widths) + MOST_TRIM
    return -(-(longest - LATEST) // ROUND) + 1
