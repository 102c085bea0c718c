"""Slots of the player: two servos of one port share a slot and begin together, or shortly after each other.

In: the servos and the frame. Out: `Layout`: the slots in order, and how many ticks of TMR0 apart they begin.

    |<----- slot ----->|<----- slot ----->|<-- the rest: the C's time -->|
    |‾‾‾‾‾‾‾|__________|‾‾‾‾‾‾‾‾‾‾|_______|______________________________|
    |‾‾‾‾‾‾‾‾‾‾‾|______|‾‾‾‾‾‾|___________|______________________________|

The timer runs freely through its prescaler and is never written (DS35007 section 5.1): a tick is 32 cycles,
or more where pulses are long. A slot begins when the timer has gone on by the slot's ticks. The timer has 8
bits, so no slot is longer than 255 ticks: a long rest is cut by slots without pulses, and the C for the next
frame runs in the last part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from servogen.errors import InputError
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

NONE = Cycles(0)
TICKS = (Cycles(32), Cycles(64), Cycles(128), Cycles(256))
MOST_TICKS = 255

STAGGER = Cycles(32)
"""By how much the second servo of a slot rises later, where no two may start together."""

TAIL = Cycles(19)
"""The kernel's cycles after the later fall."""

SLOT_C, FRAME_C, CHANNEL_C, DOUBLING_C = Cycles(200), Cycles(85), Cycles(249), Cycles(4)
"""What the C gets at least: between two slots (with the kernel's own preparation), between two frames in
addition, there for each channel, and for each doubling of a channel's step. What it takes is counted once it
is compiled."""

EASES = ((3, 3), (2, 2), (2, 1), (1, 1))
"""How many times that the C gets between slots and between frames, as far as there is room: other compilers'
code is longer."""

MOST_TRIM = Cycles(127)
"""What the trim in the EEPROM can add to a pulse."""

LEAST_WIDTH = Cycles(192)
"""The kernel's way from the rise to the first fall, a stagger, and the shortest trim."""


@dataclass(frozen=True, slots=True)
class Slot:
    """`channels`: one or two, by index, none where a slot only waits; `ticks` from the slot before.

    `longest`: its longest pulse with trim and stagger.
    """

    port: str
    channels: tuple[int, ...]
    ticks: int
    longest: Cycles = NONE


@dataclass(frozen=True, slots=True)
class Layout:
    """The slots of a frame; the first begins `slots[0].ticks` after the last one of the frame before."""

    slots: tuple[Slot, ...]
    tick: Cycles
    stagger: Cycles = NONE

    @property
    def period(self) -> Cycles:
        return Cycles(self.tick * sum(slot.ticks for slot in self.slots))

    def rise(self, channel: int) -> Cycles:
        """The cycle of the frame in which that channel's pulse begins."""
        at = 0
        for number, slot in enumerate(self.slots):
            at += self.tick * slot.ticks if number else 0
            if channel in slot.channels:
                return Cycles(at + self.stagger * slot.channels.index(channel))
        raise KeyError(channel)

    @property
    def order(self) -> tuple[int, ...]:
        """The channels slot by slot."""
        return tuple(channel for slot in self.slots for channel in slot.channels)

    @property
    def between_slots(self) -> Cycles:
        """The least time from the kernel's end in a slot to the last moment for the next slot's beginning."""
        pairs = zip(self.slots, self.slots[1:], strict=False)
        return Cycles(
            min((_room(one, other, self.tick) for one, other in pairs), default=self.between_frames)
        )

    @property
    def between_frames(self) -> Cycles:
        """The same from a frame's last slot to the next frame's first one."""
        return _room(self.slots[-1], self.slots[0], self.tick)


def to_rise(tick: Cycles) -> Cycles:
    """The kernel's cycles from a slot's beginning to the rise of its pins, staggered ones' cycle more."""
    return Cycles(3 * tick + 7)


def _room(slot: Slot, following: Slot, tick: Cycles) -> Cycles:
    # The kernel must have looked at the timer by the cycle before the next slot's beginning.
    return Cycles(following.ticks * tick - 1 - to_rise(tick) - slot.longest - TAIL)


def layout(servos: Sequence[Servo], frame: Frame, clock: Clock, shift: int = 0) -> Layout:
    """The slots of `servos`, two of a port at a time by order of pins. Raises InputError.

    Keyframes are in steps of 2**shift cycles.
    """
    motion_c = FRAME_C + len(servos) * (CHANNEL_C + shift * DOUBLING_C)
    stagger = STAGGER if frame.most_together == 1 else NONE
    for each in servos:
        if clock.round_us(each.widths_us[0]).cycles < LEAST_WIDTH:
            raise InputError(
                f"{each.name}: a pulse of {each.widths_us[0]:g} µs is "
                f"{clock.round_us(each.widths_us[0]).cycles} cycles, the player's least is {LEAST_WIDTH}",
                each.place,
                "take a faster clock, or narrow the servo's limits",
            )
    pairs = _pairs(servos)
    longest = [
        Cycles(
            max(clock.round_us(servos[channel].widths_us[1]).cycles for channel in pair) + MOST_TRIM + stagger
        )
        for _, pair in pairs
    ]
    for tick in TICKS:
        for slot_ease, frame_ease in EASES:
            slot_c, frame_c = slot_ease * SLOT_C, frame_ease * motion_c
            ticks = _ticks(longest, slot_c, frame_c, frame.period.cycles, tick)
            if ticks is not None:
                waits = [Slot("B", (), wait) for wait in ticks[len(pairs) :]]
                found = [
                    Slot(port, pair, ticks[number], longest[number])
                    for number, (port, pair) in enumerate(pairs)
                ]
                return Layout((*found, *waits), tick, stagger)
    least = sum(_slot(length, SLOT_C, TICKS[0]) for length in longest)
    least += motion_c
    raise InputError(
        f"the pulses do not fit a frame: those of {len(servos)} servos, two at a time, and the C for them "
        f"take {least} cycles, {float(clock.us(least)):g} µs; a frame is {frame.period.cycles} cycles, "
        f"{float(frame.period.achieved_us):g} µs",
        frame.place,
        "lengthen period_us, take a faster clock, or narrow the servos' limits",
    )


def _pairs(servos: Sequence[Servo]) -> list[tuple[str, tuple[int, ...]]]:
    """(port, channels) of each slot."""
    return [
        (port, tuple(mine[first : first + 2]))
        for port in ("B", "A")
        for mine in [
            sorted((i for i, s in enumerate(servos) if s.pin[1] == port), key=lambda i: servos[i].pin)
        ]
        for first in range(0, len(mine), 2)
    ]


def _slot(longest: int, c: int, tick: int) -> int:
    """The cycles from a slot's beginning to the next one's, if the C takes `c` between them."""
    return to_rise(Cycles(tick)) + longest + TAIL + c + 1


def _ticks(longest: Sequence[int], slot_c: int, frame_c: int, period: int, tick: int) -> list[int] | None:
    """The ticks before each slot, and before each that only waits; None where they do not fit."""

    def whole(pulse: int, c: int) -> int:
        return -(-_slot(pulse, c, tick) // tick)

    slots = [whole(each, slot_c) for each in longest]
    rest = round(period / tick) - sum(slots[:-1])
    one = [whole(longest[-1], slot_c + frame_c)]
    several = [slots[-1], whole(0, slot_c + frame_c)]
    while len(several) * MOST_TICKS < rest:
        several.insert(1, whole(0, slot_c))
    parts = one if rest <= MOST_TICKS else several
    spare = rest - sum(parts)
    if spare < 0 or max(*slots, *parts) > MOST_TICKS:
        return None
    for number in reversed(range(len(parts))):
        more = min(spare, MOST_TICKS - parts[number])
        parts[number] += more
        spare -= more
    # Each slot's ticks are counted from the slot before; the first slot's from the end of the rest.
    return [parts[-1], *slots[:-1], *parts[:-1]]
