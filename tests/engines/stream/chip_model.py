"""What the chip does with the commands that it receives: its arithmetic, bit for bit.

In: commands, each with the cycle in which its last stop bit is looked at. Out: the width of every pulse, and
the `PulseSchedule` that they are.

    rise of slot:  n-2               n-1               n
                    |                 |                 |
                    └ what came until then counts       └ the pulse
                                      └ is reckoned
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby

from servogen.engines.inputs.serial import NEUTRAL, OFF
from servogen.engines.stream.protocol import (
    NO_TRIM,
    SYNC,
    TRIM_ZERO,
    CommandKind,
    StreamCommand,
    command_of,
    trim_byte,
    trim_cycles,
)
from servogen.engines.stream.streaming import Streaming
from servogen.pulse.schedule import Pulse, PulseSchedule, Run
from servogen.units import Cycles

Width = Cycles | None
"""Of a pulse; None where there is none."""


@dataclass(slots=True)
class Receiver:
    """Bytes to commands: what is between a beginning and the next is a command when it has two bytes."""

    servos: int
    trims: bool = True
    """Whether it is not coarse."""
    answers: bool = False
    """Whether it has a pin to send on; it then hears nothing while it answers."""
    _second: int | None = None
    _begun: bool = False

    def byte(self, value: int) -> StreamCommand | None:
        """The command that this byte ends."""
        if value == SYNC:
            self._begun, self._second = True, None
        elif self._begun:
            self._begun, self._second = False, value
        elif self._second is not None:
            second, self._second = self._second, None
            return command_of(second, value, self.servos, answers=self.answers, trims=self.trims)
        return None

    def broken(self) -> None:
        """A byte without a stop bit: the command that it belongs to is lost."""
        self._begun, self._second = False, None


@dataclass(slots=True)
class Chip:
    """The chip's variables; it starts as after a reset. A width of 0 is a servo without pulses.

    A coarse chip's widths and goals are positions and 1, and its group is all servos.
    """

    streamed: Streaming
    eeprom: dict[int, int] = field(default_factory=dict)
    """Byte n is servo n's trim; those that are not there are erased."""
    _widths: list[int] = field(init=False)
    _goals: list[int] = field(init=False)
    _speeds: list[int] = field(init=False)
    _waiting: set[int] = field(default_factory=set)
    _group: set[int] = field(default_factory=set)
    _left: int = 0
    _starting: bool = False
    """The group starts with the next frame."""
    _gathering: bool = False
    _silence: int = 0

    def __post_init__(self) -> None:
        self._goals = [self._neutral(n) for n in range(len(self.streamed.neutral))]
        self._widths = list(self._goals)
        self._speeds = [0] * len(self._goals)

    def trim(self, n: int) -> int:
        return trim_cycles(self.eeprom.get(n, NO_TRIM))

    def _neutral(self, n: int) -> int:
        width = self.streamed.neutral[n]
        return self.streamed.travels[n].nearest(width) + 1 if self.streamed.coarse else width + self.trim(n)

    def execute(self, command: StreamCommand) -> None:
        """What a command does."""
        n, value, everybody = command.servo, command.value, set(range(len(self._goals)))
        coarse = self.streamed.coarse
        if command.kind is CommandKind.POSITION:
            self._goals[n] = value + 1 if coarse else self.streamed.travels[n].width(value) + self.trim(n)
            if not self._widths[n]:
                self._widths[n] = self._goals[n]
            if not coarse:
                self._group.discard(n)
                (self._waiting.add if self._gathering else self._waiting.discard)(n)
        elif command.kind is CommandKind.SPEED:
            self._speeds[n] = value
        elif command.kind is CommandKind.TRIM:
            self._set_trim(n, value - TRIM_ZERO)
        elif command.kind is CommandKind.GROUP and value:
            self._gathering, self._starting = False, True
            self._group, self._waiting, self._left = everybody if coarse else self._waiting, set(), value
        elif command.kind is CommandKind.GROUP:
            self._gathering = True
            self._waiting = everybody if coarse else self._waiting
        self._silence = 0

    def _set_trim(self, n: int, cycles: int) -> None:
        before = self.trim(n)
        self.eeprom[n] = trim_byte(cycles)
        if self._goals[n]:
            self._goals[n] += self.trim(n) - before
            self._widths[n] += self.trim(n) - before

    def begin_frame(self) -> None:
        if self._starting:
            self._starting = False
        elif self._left:
            self._left -= 1
            if not self._left:
                self._group = set()
        if self._silence > self.streamed.silence_frames:
            return
        self._silence += 1
        if self._silence == self.streamed.silence_frames and self.streamed.stream.fail_safe == NEUTRAL:
            self._group, self._waiting = set(range(len(self._goals))), set()
            self._gathering, self._starting, self._left = False, True, self.streamed.soft_frames

    def prepare(self, n: int) -> Width:
        """The width of servo n's next pulse."""
        fail_safe = self.streamed.stream.fail_safe
        if self._silence == self.streamed.silence_frames and fail_safe == NEUTRAL and n in self._group:
            self._goals[n] = self._neutral(n)
        if self._silence >= self.streamed.silence_frames and fail_safe == OFF:
            self._goals[n] = self._widths[n] = 0
        way = self._goals[n] - self._widths[n]
        step = abs(way)
        if n in self._waiting or (n in self._group and self._starting):
            step = 0
        elif n in self._group:
            step //= self._left
        elif self._speeds[n]:
            step = min(step, self._speeds[n])
        self._widths[n] += step if way > 0 else -step
        if self.streamed.coarse and self._widths[n]:
            return self.streamed.travels[n].width(self._widths[n] - 1)
        return Cycles(self._widths[n]) or None


def widths(
    streamed: Streaming, commands: Iterable[tuple[int, StreamCommand]], chip: Chip | None = None
) -> Iterator[tuple[Width, ...]]:
    """The pulses of each frame, for ever.

    `commands`: cycles from the first servo's first rise, in order, and what was received then; what came
    until a slot's rise counts for the slot after the next. `chip`: as it was left, else after a reset.
    """
    coming = iter(commands)
    ahead = next(coming, None)
    chip = chip or Chip(streamed)
    slots, slot_cycles = streamed.layout.slots, streamed.layout.period // streamed.layout.slots
    servos = len(streamed.neutral)
    rise = -slot_cycles
    while True:
        frame: list[Width] = []
        for slot in range(slots):
            if slot == 0:
                chip.begin_frame()
            if slot < servos:
                frame.append(chip.prepare(slot))
            while ahead is not None and ahead[0] <= rise:
                chip.execute(ahead[1])
                ahead = next(coming, None)
            rise += slot_cycles
        yield tuple(frame)


def schedule(streamed: Streaming, frames: Iterable[tuple[Width, ...]]) -> PulseSchedule:
    """Frames of widths as a schedule; the last one is repeated for ever."""
    rises = [streamed.layout.rise(n) for n in range(len(streamed.neutral))]

    def pulses(each: tuple[Width, ...]) -> tuple[Pulse | None, ...]:
        return tuple(
            None if width is None else Pulse(rise, width) for rise, width in zip(rises, each, strict=True)
        )

    runs = [Run(len(list(same)), pulses(each)) for each, same in groupby(frames)]
    return replace(streamed.plan.schedule, lead_in=tuple(runs), loop=(Run(1, runs[-1].pulses),))
