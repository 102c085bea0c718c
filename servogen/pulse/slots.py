"""Slots: the pulse of each channel begins at a fixed cycle of the frame.

In: the servos in order and the frame. Out: the cycle at which each pulse rises. A slot is as long as the
servo's longest pulse plus a gap, whatever the motion, so that rises are always exactly one period apart.

    |<- slot 0 ->|<- slot 1 ->|      rest of the frame      |
    |‾‾‾‾|_______|‾‾‾‾‾‾|_____|_____________________________|
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from servogen.errors import InputError, Location
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles, Rounded

GAP_US = Fraction(250)
"""The default gap between the longest pulse of a slot and the next slot."""

MIN_GAP = Cycles(64)
"""The minimum number of cycles between two edges if the program waits in a loop between them."""


@dataclass(frozen=True, slots=True)
class Frame:
    """The frame: its period, the gap between slots, and the length of every slot if the job states it."""

    period: Rounded
    gap_us: Fraction = GAP_US
    slot_us: Fraction | None = None
    per_slot: int = 1
    """The number of servos whose pulses begin together in a slot."""
    max_together: int | None = None
    """The maximum number of pulses that may start together; None: any number."""
    place: Location | None = None


def rises(servos: Sequence[Servo], frame: Frame, clock: Clock) -> tuple[Cycles, ...]:
    """Return the cycle of the frame in which each servo's pulse begins. Raises InputError if they do not
    fit.
    """
    if frame.max_together is not None and frame.per_slot > frame.max_together:
        raise InputError(
            "frame-too-short",
            f"per_slot = {frame.per_slot} servos start together, max_together allows {frame.max_together}",
            frame.place,
            f"write per_slot = {frame.max_together}",
        )
    gap = max(clock.round_us(frame.gap_us).cycles, MIN_GAP)
    start, starts = 0, []
    for first in range(0, len(servos), frame.per_slot):
        together = servos[first : first + frame.per_slot]
        starts += [Cycles(start)] * len(together)
        longest = max(together, key=lambda servo: servo.widths_us[1])
        width = clock.round_us(longest.widths_us[1]).cycles
        slot = width + gap
        if frame.slot_us is not None:
            slot = clock.round_us(frame.slot_us).cycles
            if slot < width + MIN_GAP:
                raise InputError(
                    "frame-too-short",
                    f"a slot of {float(frame.slot_us):g} µs is too short for {longest.name}",
                    frame.place,
                    f"its longest pulse and the minimum gap take {float(clock.us(width + MIN_GAP)):g} µs",
                )
        start += slot
    if start > frame.period.cycles:
        raise _do_not_fit(servos, frame, clock, Cycles(start))
    return tuple(starts)


def _do_not_fit(servos: Sequence[Servo], frame: Frame, clock: Clock, taken: Cycles) -> InputError:
    """Return the error for too many pulses, or for a clock too slow for the cycles between them."""
    message = (
        f"the pulses do not fit a frame: {len(servos)}, {frame.per_slot} at a time, take "
        f"{float(clock.us(taken)):.10g} µs, the frame has {float(frame.period.requested_us):.10g} µs"
    )
    between = clock.us(MIN_GAP)
    if between <= max(frame.gap_us, GAP_US):
        hint = "lengthen period_us, shorten gap_us, raise per_slot, or narrow the servos' limits"
        return InputError("frame-too-short", message, frame.place, hint)
    return InputError(
        "frame-too-short",
        f"{message}; at {clock.hz} Hz the {MIN_GAP} cycles from one edge to the next take "
        f"{float(between):.10g} µs",
        frame.place,
        "use a faster clock",
    )
