"""Slots of the player: two servos of one port share a slot and begin together.

In: the servos and the frame. Out: `Layout`: the slots in order, and how many ticks of TMR0 apart they begin.

    |<----- slot ----->|<----- slot ----->|<-- the rest: the C's time -->|
    |‾‾‾‾‾‾‾|__________|‾‾‾‾‾‾‾‾‾‾|_______|______________________________|
    |‾‾‾‾‾‾‾‾‾‾‾|______|‾‾‾‾‾‾|___________|______________________________|

A tick is 32 cycles: the timer runs at 1:32 and is never written (DS35007 section 5.1); a slot begins when the
timer has gone on by the slot's ticks. The timer has 8 bits, so no slot is longer than 255 ticks: a long rest
is cut by slots without pulses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from servogen.errors import InputError
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

TICK = Cycles(32)
MOST_TICKS = 255

BETWEEN = Cycles(352)
"""What a slot takes beside its longest pulse: sorting the two, the lock on the timer, the C around it."""

PER_FRAME, PER_CHANNEL = Cycles(200), Cycles(240)
"""What the C between two frames takes, and what each channel's width adds to that."""

MOST_TRIM = Cycles(127)
"""What the trim in the EEPROM can add to a pulse."""

LEAST_WIDTH = Cycles(192)
"""The kernel's way from the rise to the first fall, the shortest trim and a reserve."""


@dataclass(frozen=True, slots=True)
class Slot:
    """`channels`: one or two, by index, none where a slot only waits; `ticks` from the slot before."""

    port: str
    channels: tuple[int, ...]
    ticks: int


@dataclass(frozen=True, slots=True)
class Layout:
    """The slots of a frame; the first begins `slots[0].ticks` after the last one of the frame before."""

    slots: tuple[Slot, ...]

    @property
    def period(self) -> Cycles:
        return Cycles(TICK * sum(slot.ticks for slot in self.slots))

    def rise(self, channel: int) -> Cycles:
        """The cycle of the frame in which that channel's pulse begins."""
        at = 0
        for number, slot in enumerate(self.slots):
            at += slot.ticks if number else 0
            if channel in slot.channels:
                break
        return Cycles(TICK * at)

    @property
    def order(self) -> tuple[int, ...]:
        """The channels slot by slot."""
        return tuple(channel for slot in self.slots for channel in slot.channels)


def layout(servos: Sequence[Servo], frame: Frame, clock: Clock) -> Layout:
    """The slots of `servos`, two of a port at a time by order of pins. Raises InputError."""
    pairs = [
        (port, mine[first : first + 2])
        for port in ("B", "A")
        for mine in [
            sorted((i for i, s in enumerate(servos) if s.pin[1] == port), key=lambda i: servos[i].pin)
        ]
        for first in range(0, len(mine), 2)
    ]
    for each in servos:
        if clock.round_us(each.widths_us[0]).cycles < LEAST_WIDTH:
            raise InputError(
                f"{each.name}: a pulse of {each.widths_us[0]:g} µs is shorter than {LEAST_WIDTH} cycles",
                each.place,
                "take a faster clock, or narrow the servo's limits",
            )
    lengths = [
        max(clock.round_us(servos[channel].widths_us[1]).cycles for channel in pair) for _, pair in pairs
    ]
    ticks = [-(-(length + MOST_TRIM + BETWEEN) // TICK) for length in lengths]
    if max(ticks) > MOST_TICKS:
        raise InputError(
            f"at {clock.hz} Hz a slot of the player has at most {MOST_TICKS * TICK} cycles: "
            f"the longest pulse asks for {max(ticks) * TICK}",
            frame.place,
            "take a slower clock, or narrow the servos' limits",
        )
    whole = round(frame.period.cycles / TICK)
    rest = whole - sum(ticks[:-1])
    least = ticks[-1] - (-(PER_FRAME + len(servos) * PER_CHANNEL) // TICK)
    if rest < least:
        raise InputError(
            f"the pulses do not fit a frame: those of {len(servos)} servos, two at a time, and the C "
            f"for them take {float(clock.us(TICK * (whole - rest + least))):g} µs, a frame "
            f"{float(frame.period.achieved_us):g} µs",
            frame.place,
            "lengthen period_us, or narrow the servos' limits",
        )
    # Each slot's ticks are counted from the slot before: what follows a slot is as long as that slot needs.
    before = [0, *ticks[:-1]]
    waits = []
    while rest > MOST_TICKS:
        waits.append(min(MOST_TICKS, max(rest - MOST_TICKS, ticks[-1])))
        rest -= waits[-1]
    slots = [Slot(port, tuple(pair), after) for (port, pair), after in zip(pairs, before, strict=True)]
    slots += [Slot("B", (), wait) for wait in waits]
    slots[0] = Slot(slots[0].port, slots[0].channels, rest)
    return Layout(tuple(slots))
