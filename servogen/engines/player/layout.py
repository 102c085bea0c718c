"""Slots of the player: two servos of a port share a slot; their pulses start together or in quick succession.

In: the servos, the pulses that their motion uses, and the frame. Out: `SlotLayout`: the slots in order, and
the number of ticks of TMR0 between their beginnings.

    |<----- slot ----->|<----- slot ----->|<-- the rest: the C's time -->|
    |‾‾‾‾‾‾‾|__________|‾‾‾‾‾‾‾‾‾‾|_______|______________________________|
    |‾‾‾‾‾‾‾‾‾‾‾|______|‾‾‾‾‾‾|___________|______________________________|

The timer runs freely through its prescaler and is never written (DS35007 section 5.1): a tick is 32 cycles,
or more if pulses are long. A slot begins when the timer has advanced by the slot's ticks. The timer has 8
bits, so slots are at most 255 ticks long: a long rest is divided by slots without pulses, and the C for the
next frame runs in its last part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

from servogen.edges import PINS
from servogen.engines.inputs.wire import FrameWire
from servogen.errors import InputError
from servogen.pulse.schedule import awaited_early
from servogen.pulse.slots import Frame
from servogen.robot.servo import Servo
from servogen.units import Clock, Cycles

NONE = Cycles(0)
TICKS = (Cycles(32), Cycles(64), Cycles(128), Cycles(256))
MAX_TICKS = 255

STAGGER = Cycles(32)
"""The cycles by which the second servo of a slot rises later if no two may start together."""

TAIL = Cycles(19)
"""The kernel's cycles after the later falling edge."""

SLOT_C, FRAME_C, LEGS_C, CHANNEL_C, DOUBLING_C = Cycles(200), Cycles(250), Cycles(400), Cycles(240), Cycles(4)
"""The minimum cycles reserved for the C: between two slots (including the kernel's own preparation); in
addition between two frames, there for the laws of legs, for each channel, and for each doubling of a
channel's step. What the C really takes is counted once it is compiled."""

BUTTONS_C = Cycles(40)
"""The cycles for reading the buttons, reserved if a pin is free for one."""

EASES = ((3, 3), (2, 2), (2, 1), (1, 1))
"""The multiples of these cycles that are reserved if there is room, because other compilers' code is
longer.
"""

WATCHDOG_US = Fraction(6900)
"""The time within which a watchdog that was left on is cleared: 100 µs less than the shortest that any chip
has (DS35007 section 9, parameter 31)."""

AFTER_LOOK = 6
"""The kernel's cycles from a wire's rise, in the middle of its look, to the rise of a slot's pins."""

AFTER_SEEN, TO_LOOK = 5, 10
"""With a crystal of its own, the cycles from the look that sees the wire's rise to the timer's tick 0, and
the kernel's from a slot's beginning to its first look for it, beside three ticks and its delay.
"""
LEAST_DELAY = 4
"""The cycles of the shortest such delay."""

MAX_TRIM = Cycles(127)
"""The maximum trim in the EEPROM, in cycles of a pulse."""

MARGIN_US = Fraction(20)
"""The margin of a slot beyond the motion's longest pulse and its trim, within the servo's limits: a stance or
a pose can change by this much without moving any slot."""

MIN_WIDTH = Cycles(192)
"""The shortest pulse: the kernel's path from the rise to the first fall, a stagger, and the minimum trim."""


@dataclass(frozen=True, slots=True)
class Slot:
    """A slot: `channels` has one or two indices, none if it only waits; `ticks` count from the previous slot.

    `longest` is its longest pulse with trim and stagger.
    """

    port: str
    channels: tuple[int, ...]
    ticks: int
    longest: Cycles = NONE


@dataclass(frozen=True, slots=True)
class SlotLayout:
    """The slots of a frame; the first begins `slots[0].ticks` after the last one of the previous frame.

    If the program is `looking` at the wire of another chip, it does so in the first slot, without pulses.
    Where that chip has another crystal, this slot begins `sooner` by some ticks: the looks for the wire's
    rise in it begin `early` cycles before a frame has passed.
    """

    slots: tuple[Slot, ...]
    tick: Cycles
    stagger: Cycles = NONE
    looking: bool = False
    early: Cycles = NONE
    sooner: int = 0

    @property
    def period(self) -> Cycles:
        """Return the frame's length in cycles."""
        return Cycles(self.tick * (sum(slot.ticks for slot in self.slots) + self.sooner))

    def rise(self, channel: int) -> Cycles:
        """Return the cycle of the frame in which a channel's pulse begins."""
        cycle = 0
        for number, slot in enumerate(self.slots):
            cycle += self.tick * slot.ticks if number > self.looking else 0
            if channel in slot.channels:
                return Cycles(cycle + self.stagger * slot.channels.index(channel))
        raise KeyError(channel)

    @property
    def after_rise(self) -> Cycles:
        """Return the cycles from the wire's rise in the first slot to the first pulse of the frame.

        The look is in the last cycles before the pins of a slot with pulses would rise. With two crystals
        they are those from the look that sees the rise.
        """
        if self.early:
            return Cycles(AFTER_SEEN + self.tick * self.slots[1].ticks + to_rise(self.tick))
        return Cycles(self.tick * self.slots[1].ticks + AFTER_LOOK)

    @property
    def look_delay(self) -> int:
        """Return the kernel's delay before the first look for a rise, in cycles."""
        return (self.sooner - 3) * self.tick - self.early - AFTER_SEEN - TO_LOOK

    def for_own_crystal(self, early: Cycles) -> SlotLayout:
        """Return the layout whose looks for the wire's rise begin `early`."""
        sooner = 3 - -(early + AFTER_SEEN + TO_LOOK + LEAST_DELAY) // self.tick
        first, *others = self.slots
        slots = (replace(first, ticks=first.ticks - sooner), *others)
        return replace(self, slots=slots, early=early, sooner=sooner)

    @property
    def order(self) -> tuple[int, ...]:
        """Return the channels, slot by slot."""
        return tuple(channel for slot in self.slots for channel in slot.channels)


def to_rise(tick: Cycles) -> Cycles:
    """Return the kernel's cycles from a slot's beginning to the rise of its pins, without the stagger."""
    return Cycles(3 * tick + 7)


@dataclass(frozen=True, slots=True)
class Used:
    """The shortest and the longest pulse of a servo's motion, without the trim of the EEPROM."""

    shortest: Cycles
    longest: Cycles

    def room(self, servo: Servo, clock: Clock) -> Cycles:
        """Return the length that a slot keeps for the servo's pulse: with a margin, within its limits."""
        margin = self.longest + clock.round_us(MARGIN_US).cycles
        return Cycles(max(self.longest, min(margin, clock.round_us(servo.widths_us[1]).cycles)))


def layout(
    servos: Sequence[Servo],
    used: Sequence[Used],
    frame: Frame,
    clock: Clock,
    doublings: int = 0,
    *,
    legs: bool = False,
    wire: FrameWire | None = None,
    motion_c: Cycles | None = None,
) -> SlotLayout:
    """Return the slots of `servos`, two of a port at a time: by pins if that fits, else by pulse length;
    before them one for looking at the `wire` that is followed.

    `used` are the pulses of the motion, one entry per servo; `doublings` is the number of times, over all
    channels, that the C doubles a value. `motion_c` are the cycles reserved for the C between two frames if
    it is not the player's. Raises InputError.
    """
    if motion_c is None:
        motion_c = _motion_c(len(servos), doublings, legs=legs)
    stagger = STAGGER if frame.max_together == 1 else NONE
    for servo, widths in zip(servos, used, strict=True):
        if widths.shortest < MIN_WIDTH:
            raise InputError(
                "pulse-too-short",
                f"{servo.name}: a pulse of {float(clock.us(widths.shortest)):g} µs is "
                f"{widths.shortest} cycles, the player's minimum is {MIN_WIDTH}",
                servo.place,
                "choose a faster clock",
            )
    rooms = [widths.room(servo, clock) for servo, widths in zip(servos, used, strict=True)]
    look: Pairs = [("B", ())] if wire else []
    early = awaited_early(frame.period.cycles, wire.crystal_ppm) if wire else NONE
    if early:
        # `for_own_crystal` takes three ticks, 19 cycles, and what rounding to ticks adds
        motion_c = Cycles(motion_c + early + 5 * TICKS[0])
    for pairs in ([*look, *_by_pins(servos)], [*look, *_by_length(servos, rooms)]):
        longest = _longest(pairs, rooms, stagger)
        fitting = _slots(pairs, longest, motion_c, frame, clock)
        if fitting is not None:
            slots = SlotLayout(fitting[0], fitting[1], stagger, looking=wire is not None)
            if not wire or not early:
                return slots
            return slots.for_own_crystal(awaited_early(slots.period, wire.crystal_ppm))
    minimum = demand(servos, used, frame, clock, doublings, legs=legs, motion_c=motion_c).minimum
    raise InputError(
        "frame-too-short",
        f"the pulses do not fit a frame: those of {len(servos)} servos, two at a time, and the C for them "
        f"take {minimum} cycles, {float(clock.us(minimum)):g} µs; a frame is {frame.period.cycles} cycles, "
        f"{float(frame.period.achieved_us):g} µs",
        frame.place,
        "lengthen period_us, or choose a faster clock",
    )


@dataclass(frozen=True, slots=True)
class Demand:
    """What the shortest frame consists of, in cycles: its slots, and the C for the next frame."""

    slots: tuple[tuple[tuple[int, ...], Cycles], ...]
    """The channels of each slot, and its length with the C after it."""
    frame_c: Cycles

    @property
    def minimum(self) -> Cycles:
        """Return the length of the shortest frame."""
        return Cycles(sum(cycles for _, cycles in self.slots) + self.frame_c)


def demand(
    servos: Sequence[Servo],
    used: Sequence[Used],
    frame: Frame,
    clock: Clock,
    doublings: int = 0,
    *,
    legs: bool = False,
    motion_c: Cycles | None = None,
) -> Demand:
    """Return the lengths of the slots if servos with pulses of similar lengths share them."""
    if motion_c is None:
        motion_c = _motion_c(len(servos), doublings, legs=legs)
    rooms = [widths.room(servo, clock) for servo, widths in zip(servos, used, strict=True)]
    pairs = _by_length(servos, rooms)
    longest = _longest(pairs, rooms, STAGGER if frame.max_together == 1 else NONE)
    size = FrameTimes(longest, SLOT_C, motion_c, TICKS[0], frame.period.cycles)
    lengths = [Cycles(size.whole(width, SLOT_C) * TICKS[0]) for width in longest]
    slots = tuple((pair, length) for (_, pair), length in zip(pairs, lengths, strict=True))
    return Demand(slots, Cycles(size.minimum * TICKS[0] - sum(lengths)))


def _motion_c(channels: int, doublings: int, *, legs: bool) -> Cycles:
    """Return the cycles reserved for the C between two frames."""
    buttons = BUTTONS_C if channels < len(PINS) else 0
    return Cycles(FRAME_C + channels * CHANNEL_C + doublings * DOUBLING_C + (LEGS_C if legs else 0) + buttons)


def _longest(pairs: Pairs, rooms: Sequence[Cycles], stagger: Cycles) -> tuple[Cycles, ...]:
    """Return the longest pulse of each slot, with a trim and the later rise."""
    return tuple(
        Cycles(max(rooms[channel] for channel in pair) + MAX_TRIM + stagger if pair else 0)
        for _, pair in pairs
    )


Pairs = Sequence[tuple[str, tuple[int, ...]]]
"""(port, channels) of each slot."""


def _slots(
    pairs: Pairs, longest: tuple[Cycles, ...], motion_c: int, frame: Frame, clock: Clock
) -> tuple[tuple[Slot, ...], Cycles] | None:
    """Return the slots and the tick with which the pairs fit a frame; None if they do not."""
    fed = clock.round_us(WATCHDOG_US).cycles
    for tick, maximum, ease in product(TICKS, (fed, None), EASES):
        size = FrameTimes(longest, ease[0] * SLOT_C, ease[1] * motion_c, tick, frame.period.cycles)
        # The reserve for other compilers' code must not delay clearing the watchdog.
        ticks = size.ticks(maximum, exceed=ease == EASES[-1])
        if ticks is not None:
            waits = [Slot("B", (), wait) for wait in ticks[len(pairs) :]]
            slots = [
                Slot(port, pair, ticks[number], longest[number]) for number, (port, pair) in enumerate(pairs)
            ]
            return (*slots, *waits), tick
    return None


def _by_pins(servos: Sequence[Servo]) -> Pairs:
    """Return the slots of servos in the order of their pins."""
    return _paired(servos, sorted(range(len(servos)), key=lambda index: servos[index].pin))


def _by_length(servos: Sequence[Servo], rooms: Sequence[Cycles]) -> Pairs:
    """Return the slots of servos with similar pulses, so that all slots together are as short as possible."""
    return _paired(servos, sorted(range(len(servos)), key=lambda index: (rooms[index], servos[index].pin)))


def _paired(servos: Sequence[Servo], order: Sequence[int]) -> Pairs:
    return [
        (port, tuple(mine[first : first + 2]))
        for port in ("B", "A")
        for mine in [[index for index in order if servos[index].pin[1] == port]]
        for first in range(0, len(mine), 2)
    ]


def _slot(longest: int, c: int, tick: int) -> int:
    """Return the cycles from a slot's beginning to that of the next one if the C takes `c` between them."""
    return to_rise(Cycles(tick)) + longest + TAIL + c + 1


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """The components of a frame's ticks, in cycles: the longest pulse of each slot, and the time of the C."""

    longest: tuple[int, ...]
    slot_c: int
    frame_c: int
    tick: int
    period: int

    def whole(self, pulse: int, c: int) -> int:
        """Return the ticks of a slot with a pulse of `pulse` cycles and `c` cycles of C after it."""
        return -(-_slot(pulse, c, self.tick) // self.tick)

    @property
    def minimum(self) -> int:
        """Return the ticks of the shortest frame."""
        *others, last = self.longest
        return sum(self.whole(other, self.slot_c) for other in others) + self.whole(
            last, self.slot_c + self.frame_c
        )

    def ticks(self, fed: int | None, *, exceed: bool) -> list[int] | None:
        """Return the ticks before each slot and each waiting slot; None if they do not fit.

        `fed` is the number of cycles within which the kernel must clear the watchdog; None if there is no
        such limit. With `exceed`, the time reserved for the C may exceed it.
        """
        slots = [self.whole(width, self.slot_c) for width in self.longest]
        rest = round(self.period / self.tick) - sum(slots[:-1])
        minimum = [self.whole(self.longest[-1], self.slot_c + self.frame_c)]
        while sum(minimum) <= rest or len(minimum) == 1:
            maximum = [self._maximum(part, 0, fed) for part in minimum[:-1]]
            maximum.append(self._maximum(minimum[-1], self.longest[0], fed))
            late = not exceed and any(part > self._limit(0, fed) for part in minimum)
            if not late and sum(minimum) <= rest <= sum(maximum) and max(*slots, *maximum) <= MAX_TICKS:
                parts = _filled(minimum, maximum, rest)
                # Ticks are counted from the previous slot, so those of the first slot come last in the rest.
                return [parts[-1], *slots[:-1], *parts[:-1]]
            # One more slot without pulses, since the rest exceeds what 8 bits, or the watchdog, allow as one
            # wait.
            waits = [self.whole(0, self.slot_c)] * (len(minimum) - 1)
            minimum = [slots[-1], *waits, self.whole(0, self.slot_c + self.frame_c)]
        return None

    def _maximum(self, minimum: int, pulse: int, fed: int | None) -> int:
        """Return the maximum ticks of a part: nothing clears the watchdog in it and in the pulse after it."""
        return max(minimum, self._limit(pulse, fed))

    def _limit(self, pulse: int, fed: int | None) -> int:
        cycles = MAX_TICKS * self.tick if fed is None else fed - to_rise(Cycles(self.tick)) - pulse
        return min(MAX_TICKS, cycles // self.tick)


def _filled(minimum: list[int], maximum: list[int], whole: int) -> list[int]:
    """Return parts that add up to `whole`, the later ones as long as possible."""
    parts, spare = list(minimum), whole - sum(minimum)
    for number in reversed(range(len(parts))):
        more = min(spare, maximum[number] - parts[number])
        parts[number] += more
        spare -= more
    return parts
