"""A serial line with everything that can be on one: right, torn, wrong and noisy frames at wrong baud rates.

In: a stream job's numbers and a seed. Out: the line's changes, and the commands that a receiver hears.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

from servogen.edges import HIGH, LOW
from servogen.engines.stream.protocol import (
    FINE_SERVOS,
    MAX_VALUE,
    SYNC,
    CommandKind,
    StreamCommand,
    group_begins,
    group_goes,
    position_command,
    query_command,
    speed_command,
    trim_command,
)
from servogen.engines.stream.streaming import Streaming
from servogen.simulator import LevelChange
from servogen.units import Clock
from tests.engines.stream.chip_model import Receiver

GUARD = 260
"""Cycles around a slot's rise in which no command of a random line ends: which side it falls on is open."""

PAUSES_S = {CommandKind.TRIM: 0.03, CommandKind.QUERY: 0.02}
"""So long a sender waits for the EEPROM, and for an answer: three slots and a byte."""
GLITCH = 70
"""Cycles: the longest low that is surely no start bit."""


@dataclass(slots=True)
class Line:
    """Written from left to right; `heard` are (cycle after reset, command)."""

    streamed: Streaming
    pin: int
    first_rise: int
    dice: random.Random
    now: Fraction = Fraction(50_000)
    changes_made: list[LevelChange] = field(default_factory=list)
    heard: list[tuple[int, StreamCommand]] = field(default_factory=list)
    sent: int = 0
    _receiver: Receiver = field(init=False)

    def __post_init__(self) -> None:
        answers = self.streamed.stream.transmit_pin is not None
        self._receiver = Receiver(len(self.streamed.neutral), not self.streamed.coarse, answers)
        self.changes_made.append(LevelChange(0, self.pin, HIGH))

    @property
    def bit(self) -> Fraction:
        return self.streamed.plan.schedule.clock.cycles_per_second / self.streamed.stream.baud

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        yield from self.changes_made

    def idle(self, bits: float) -> None:
        self.now += self.bit * Fraction(bits).limit_denominator(1000)

    def seconds(self, seconds: float) -> None:
        self.idle(seconds * self.streamed.stream.baud)

    def level(self, level: int) -> None:
        self.changes_made.append(LevelChange(int(self.now), self.pin, level))

    def byte(self, value: int, rate: Fraction, stop: bool = True) -> None:
        """One byte; `rate` is how long its bits are. Without a stop bit the line is low for 10 bits."""
        bit = self.bit * rate
        start, before = self.now, HIGH
        for number, one in enumerate((0, *(value >> n & 1 for n in range(8)), int(stop))):
            if one != before:
                self.changes_made.append(LevelChange(int(start + number * bit), self.pin, one))
                before = one
        self.now = start + 10 * bit
        if not stop:
            self._receiver.broken()
            self.level(HIGH)
            self.idle(3)
            return
        command = self._receiver.byte(value)
        if command:
            self.heard.append((int(start + bit * Fraction(19, 2)), command))
        if command:
            self.seconds(PAUSES_S.get(command.kind, 0))

    def send(self, data: bytes, error: Fraction | None = None) -> None:
        """Bytes at one rate, wrong by `error` (by chance up to 2 %), here and there with a little pause."""
        wrong = Fraction(self.dice.randint(-200, 200), 10_000) if error is None else error
        rate = 1 / (1 + wrong)
        pauses = [self.dice.choice((0, 0, 0, self.dice.random() * 3)) for _ in data]
        length = self.bit * (10 * len(data) * rate + sum(Fraction(p).limit_denominator(1000) for p in pauses))
        self._keep_clear(int(length - self.bit * rate / 2))
        for value, pause in zip(data, pauses, strict=True):
            self.idle(pause)
            self.byte(value, rate)
        self.sent += 1

    def _keep_clear(self, after: int) -> None:
        """Waits until what ends `after` cycles from now does not end at a slot's rise."""
        slot = self.streamed.layout.rounds * 256
        phase = (int(self.now) + after - self.first_rise + GUARD) % slot
        if phase < 2 * GUARD:
            self.now += 2 * GUARD - phase

    def noise(self, seconds: float) -> None:
        """A line that goes up and down at random, and is quiet for two bytes after that.

        It does not come in the midst of a frame, which it could end: three bytes have no check.
        """
        self.send(bytes((SYNC, 0xFE, 0)))
        end = self.now + self.bit * self.streamed.stream.baud * Fraction(seconds).limit_denominator(10_000)
        level = LOW
        while self.now < end:
            self.level(level)
            level = HIGH - level
            self.now += self.dice.randint(10, 600)
        self.level(HIGH)
        self.idle(20)


def talk(line: Line, seconds: float) -> None:
    """Anything, for so long: nine of ten frames are right."""
    end = line.now + line.bit * line.streamed.stream.baud * Fraction(seconds).limit_denominator(1000)
    servos = len(line.streamed.neutral)
    dice = line.dice
    kinds = (position, speed, group, trim, query, torn, wrong, anything, broken, glitch, quiet, silent)
    weights = (60, 6, 6, 1, 2, 4, 4, 3, 3, 4, 8, 0.3)
    while line.now < end:
        dice.choices(kinds, weights)[0](line, dice.randrange(servos))


def position(line: Line, servo: int) -> None:
    line.send(position_command(servo, line.dice.randint(0, MAX_VALUE)))


def speed(line: Line, servo: int) -> None:
    line.send(speed_command(servo, line.dice.choice((0, 1, 5, 20, 100, 254))))


def group(line: Line, servo: int) -> None:
    line.send(group_begins())
    for _ in range(line.dice.randint(0, len(line.streamed.neutral))):
        position(line, line.dice.randrange(len(line.streamed.neutral)))
    line.send(group_goes(line.dice.choice((1, 2, 7, 30, 254))))


def trim(line: Line, servo: int) -> None:
    cycles = line.dice.randint(-127, 127)
    line.send(trim_command(servo % FINE_SERVOS, cycles + (cycles == -1)))


def query(line: Line, servo: int) -> None:
    line.send(query_command(servo % FINE_SERVOS, low=line.dice.random() < 0.5))


def torn(line: Line, servo: int) -> None:
    line.send(position_command(servo, line.dice.randint(0, MAX_VALUE))[: line.dice.randint(1, 2)])
    line.idle(line.dice.random() * 40)


def wrong(line: Line, servo: int) -> None:
    second = line.dice.choice((servo + 8, 0x38 + servo, 0x48, 0x81, 0xC8, 0xEF, 0xF1, 0xFE))
    line.send(bytes((SYNC, second, line.dice.randint(0, MAX_VALUE))))


def anything(line: Line, servo: int) -> None:
    for _ in range(line.dice.randint(1, 6)):
        line.send(bytes((line.dice.choice((SYNC, line.dice.randint(0, 255))),)))


def broken(line: Line, servo: int) -> None:
    frame = position_command(servo, line.dice.randint(0, MAX_VALUE))
    at = line.dice.randrange(3)
    line.send(frame[:at])
    line.byte(frame[at] & 0x7F if line.dice.random() < 0.5 else 0, Fraction(1), stop=False)


def glitch(line: Line, servo: int) -> None:
    line.idle(1)
    line.level(LOW)
    line.now += line.dice.randint(1, GLITCH)
    line.level(HIGH)
    line.idle(2)


def quiet(line: Line, servo: int) -> None:
    line.idle(line.dice.random() * 60)


def silent(line: Line, servo: int) -> None:
    line.seconds(float(line.streamed.stream.silence_s) * 2 + line.dice.random())
