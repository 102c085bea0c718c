"""Sources that drive the pins from outside: levels at times, periodic signals, buttons, serial bytes, a
pressed reset.

In: cycles, pins, levels. Out: each source's changes in order, generated on demand, so that an endless one
needs no memory. `stimulus.py` merges them.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import count, islice
from typing import NamedTuple, Protocol

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN
from servogen.errors import InputError, did_you_mean
from servogen.simulator.layout import MCLR_PIN, PACK_CYCLE, PACK_PIN
from servogen.units import Clock

RELEASED = UNDRIVEN
"""The level of a pin that is released."""

STIMULUS_PINS = (*PINS, "MCLR")


class LevelChange(NamedTuple):
    """From `cycle` on, the outside world drives `pin` (its number in `STIMULUS_PINS`) to `level`."""

    cycle: int
    pin: int
    level: int

    @property
    def packed(self) -> int:
        """Return the change in the form that the instruction loop reads."""
        return self.cycle << PACK_CYCLE | self.pin << PACK_PIN | self.level


class SignalSource(Protocol):
    """A signal source outside the chip."""

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        """Yield its changes in order of cycles, possibly without end."""


def pin_number(name: str) -> int:
    """Return the number of a pin in a stimulus. Raises InputError."""
    if name.upper() in STIMULUS_PINS:
        return STIMULUS_PINS.index(name.upper())
    raise InputError("unknown-pin", f"there is no pin '{name}'", hint=did_you_mean(name, STIMULUS_PINS))


@dataclass(frozen=True, slots=True)
class Levels:
    """Given levels from given cycles on."""

    pin: int
    at: Sequence[tuple[int, int]]
    """(cycle, level), in order."""

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        for cycle, level in self.at:
            yield LevelChange(cycle, self.pin, level)


@dataclass(frozen=True, slots=True)
class Periodic:
    """High for `high` of every `period` cycles from `start` on, `times` times or without end; low before and
    between.

    Periods may be fractions of a cycle: each edge is rounded separately, so that errors do not add up.
    """

    pin: int
    period: Fraction
    high: Fraction
    start: Fraction = Fraction(0)
    times: int | None = None

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        if self.start > 0:
            yield LevelChange(0, self.pin, LOW)
        for n in islice(count(), self.times):
            rise = self.start + n * self.period
            yield LevelChange(whole(rise), self.pin, HIGH)
            yield LevelChange(whole(rise + self.high), self.pin, LOW)


@dataclass(frozen=True, slots=True)
class BouncingButton:
    """A button to ground with a pull-up resistor: low while pressed; its contact bounces at both ends.

    After each of the two moments the level flips `bounces` times and back, at random moments (the same for
    the same `seed`) within `bounce` cycles.
    """

    pin: int
    pressed: int
    released: int
    bounces: int = 5
    bounce: int = 5000
    seed: int = 1
    active: int = LOW

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        dice = random.Random(self.seed)
        if self.pressed > 0:
            yield LevelChange(0, self.pin, 1 - self.active)
        for moment, end, level in (
            (self.pressed, self.released, self.active),
            (self.released, None, 1 - self.active),
        ):
            yield LevelChange(moment, self.pin, level)
            room = self.bounce if end is None else min(self.bounce, end - moment - 1)
            # An even number, so that the contact ends at the new level.
            flips = min(2 * self.bounces, max(0, room) // 2 * 2)
            for n, offset in enumerate(sorted(dice.sample(range(1, room + 1), flips))):
                yield LevelChange(moment + offset, self.pin, level ^ (n + 1) % 2)


@dataclass(frozen=True, slots=True)
class Serial:
    """Asynchronous bytes: start bit, eight data bits (lowest first), stop bits; idle high or `inverted`."""

    pin: int
    data: bytes
    baud: Fraction
    """The nominal bits per second of the sender."""
    start: int = 0
    baud_error: Fraction = Fraction(0)
    """The sender's relative error: 0.02 is two per cent too fast."""
    inverted: bool = False
    stop_bits: int = 1
    gap: int = 0
    """Idle cycles between two bytes in addition to the stop bits."""

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        bit = clock.cycles_per_second / (self.baud * (1 + self.baud_error))
        idle = LOW if self.inverted else HIGH
        level = idle
        yield LevelChange(0, self.pin, idle)
        begin = Fraction(self.start)
        for byte in self.data:
            bits = [0, *(byte >> n & 1 for n in range(8)), *[1] * self.stop_bits]
            for n, value in enumerate(bits):
                wanted = idle if value else 1 - idle
                if wanted != level:
                    level = wanted
                    yield LevelChange(whole(begin + n * bit), self.pin, level)
            begin += len(bits) * bit + self.gap


@dataclass(frozen=True, slots=True)
class Reset:
    """MCLR held low from one cycle up to another."""

    pressed: int
    released: int

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        yield LevelChange(self.pressed, MCLR_PIN, LOW)
        yield LevelChange(self.released, MCLR_PIN, HIGH)


def whole(cycles: Fraction) -> int:
    """Return the nearest whole cycle; a half rounds up."""
    return (2 * cycles.numerator + cycles.denominator) // (2 * cycles.denominator)
