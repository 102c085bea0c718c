"""`VirtualChip`: the simulated chip on the bench, with a crystal that deviates as real ones do.

In: an image; time, in microseconds of the bench's own clock. Out: edges at true times. Programming stops the
chip; `load` starts it with its new contents.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from heapq import heappop, heappush
from typing import Protocol

import numpy as np
import numpy.typing as npt

from servogen.bench.virtual.connections import ShortCircuit, Wiring
from servogen.edges import HIGH, LOW, PAIR_NAMES, PAIR_PINS, PIN_NAMES, UNDRIVEN, EdgeChunk, join
from servogen.pic.image import Image
from servogen.simulator import LevelChange, Machine, PairedMachine, SimulatorOptions, Stimulus
from servogen.units import Clock

Levels = tuple[npt.NDArray[np.int64], npt.NDArray[np.uint32]]
"""Non-decreasing cycles, and the levels of all pins from each of them on."""

MILLION = 10**6
MOMENT_S = 0.002
CONTACT_CYCLES = 20_000
"""The interval at which pull-ups are checked while pins are connected; pin changes take effect at once."""


class Alarm(Protocol):
    """Something that acts on the chip at certain cycles of `VirtualChip.now`."""

    def next_at(self) -> int | None: ...

    def ring(self) -> None:
        """Do all that is due now."""


class Debugger(Protocol):
    """Something that stops the chip, and takes it back: the chip's machine is run by it."""

    @property
    def stands(self) -> bool:
        """Return whether the chip is stopped."""

    def powered(self, chip: VirtualChip) -> None:
        """Take the chip, which is at power-up."""

    def run(self, cycles: int, *, to_edge: bool) -> EdgeChunk:
        """Run for `cycles`, or until it stops the chip, or just after an edge."""

    def apply(self, changes: Sequence[LevelChange]) -> None: ...

    def edges(self, begin: int, end: int) -> EdgeChunk:
        """Return the edges of the cycles from `begin` to `end`, through which it has led the chip."""


@dataclass(slots=True)
class VirtualChip:
    """The chip runs `ppm` millionths faster than its nominal clock."""

    image: Image
    clock: Clock
    options: SimulatorOptions = field(default_factory=SimulatorOptions)
    ppm: Fraction = Fraction(0)
    stimulus: Stimulus | None = None
    in_real_time: bool = False
    """Whether its time is real time; otherwise it passes only while somebody captures or sends."""
    machine: Machine = field(init=False)
    listeners: list[Callable[[Levels, int], None]] = field(default_factory=list)
    """Called with the pins' levels whenever the chip has run, and the cycle up to which it ran."""
    watched: bool = False
    """Whether the levels of runs by others are kept for `look`."""
    second: SecondChip | None = None
    """The second one of two chips on one crystal."""
    alarms: list[Alarm] = field(default_factory=list)
    debugger: Debugger | None = None
    channels: int = 0
    """The levels of the analyser's channels beyond the chip's pins, in the bits above these."""
    _wiring: Wiring = field(default_factory=Wiring)
    """What is connected to the pins; `held` are the levels from outside, by the pins' numbers."""
    _outside: dict[int, int] = field(default_factory=dict)
    """The level of each pin from outside, as the simulator knows it."""
    _later: list[tuple[int, int, int, int]] = field(default_factory=list)
    """Levels to come, a heap: (cycle, number, pin, level)."""
    _number: int = 0
    _on: bool = True
    """Whether the supply is on."""
    _before: int = 0
    """The cycles that it ran before its last reset."""
    _reset_at: float = 0.0
    _origin: int = 0
    """The cycle of the last reset by `load`."""
    _seen: list[Levels] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.second is not None:
            self.second.first = self
        self.load(self.image)

    def load(self, image: Image) -> None:
        """Load another image and reset the chip; its pins are low until it drives them."""
        self._before += self.machine.cycles if self._reset_at else 0
        self.image = image
        if self.second is None:
            self.machine = Machine(image, self.clock, self.options, self.stimulus)
        else:
            self.machine = self.second.beside(image, self.second.image, self.stimulus)
        if self.debugger is not None:
            self.debugger.powered(self)
        self._reset_at = time.monotonic()
        self._origin = self._before
        self._outside = {}
        self._settle()
        if self.watched:
            self._seen.append((np.array([self.now], dtype=np.int64), np.array([self.word], dtype=np.uint32)))

    @property
    def word(self) -> int:
        """Return the levels at the pins now, pin n of `PINS` in bit n, and the channels beyond them.

        A pin that nothing drives is low, as an analyser's input with a pull-down sees it.
        """
        driven = self.machine.traced if self._on else (UNDRIVEN,) * PAIR_PINS
        levels = [self._outside.get(pin) if level == UNDRIVEN else level for pin, level in enumerate(driven)]
        return self.channels | sum((levels[pin] == HIGH) << pin for pin in self._pins)

    @property
    def _pins(self) -> tuple[int, ...]:
        """Return the numbers of the pins of the chip, or of both."""
        return tuple(PIN_NAMES if self.second is None else PAIR_NAMES)

    @property
    def now(self) -> int:
        """Return the cycles since creation, which a reset does not set back."""
        return self._before + self.machine.cycles

    @property
    def _stands(self) -> bool:
        return self.debugger is not None and self.debugger.stands

    def due(self, most: int) -> int:
        """Return how many of `most` cycles may run now, after a short wait if the clock requires it.

        None may while a debugger has stopped the chip; real time is counted anew from then on.
        """
        if self._stands:
            time.sleep(MOMENT_S)
            self._reset_at, self._origin = time.monotonic(), self.now
            return 0
        if not self.in_real_time:
            return most
        reached = int(Fraction(time.monotonic() - self._reset_at) * self.cycles_per_second)
        ran = self.now - self._origin
        if reached <= ran:
            time.sleep(MOMENT_S)
        return max(0, min(most, reached - ran))

    @property
    def cycles_per_second(self) -> Fraction:
        """Return the cycles per second of a true clock."""
        return self.clock.cycles_per_second * (1 + self.ppm / MILLION)

    def run(self, cycles: int) -> None:
        """Run the chip for `cycles`."""
        levels = self._levels(cycles)
        if self.watched:
            self._seen.append(levels)

    def led(self, lead: Callable[[], None], *, in_the_past: bool = False) -> None:
        """Let a debugger step the chip, and all see its pins as if it had run; or take it back, or look for
        a moment in the past, while the bench's time stands.
        """
        assert self.debugger is not None
        begin, before = self._here(), int(self.machine.cycles)
        lead()
        passed = self.machine.cycles - before
        if passed < 0 or in_the_past:
            self._before -= passed
            self._tell(self._here())
        elif passed:
            self._tell(self._with_edges(begin, self.debugger.edges(before, self.machine.cycles)))
            self._ring()

    def _tell(self, levels: Levels) -> None:
        """Let those who watch the pins see what a debugger has made of them."""
        if self.watched:
            self._seen.append(levels)
        for listener in self.listeners:
            listener(levels, self.now)

    def forget(self) -> None:
        """Drop the levels that were kept for `look`."""
        self._seen.clear()

    def look(self, cycles: int) -> Levels:
        """Run the chip and return the levels since the last look; the first entry is the level at its
        beginning.
        """
        pieces = [*self._seen, self._levels(cycles)]
        self._seen.clear()
        cycle, level = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        last_of_cycle = np.append(cycle[1:] != cycle[:-1], True)
        return cycle[last_of_cycle], level[last_of_cycle]

    def drive(self, pin: int, level: int) -> None:
        """Give a pin, or MCLR, a level from outside from now on; `UNDRIVEN` lets it go."""
        if level == UNDRIVEN:
            self._wiring.held.pop(pin, None)
        else:
            self._wiring.held[pin] = level
        self._settle()

    def drive_at(self, cycle: int, pin: int, level: int) -> None:
        """Do the same at a later cycle."""
        heappush(self._later, (cycle, self._number, pin, level))
        self._number += 1

    def connect(self, wire: frozenset[int], closed: bool) -> None:
        """Connect two pins, or disconnect them."""
        (self._wiring.connect if closed else self._wiring.disconnect)(wire)
        self._settle()

    @property
    def is_slow(self) -> bool:
        """Return whether the chip is simulated edge by edge, because pins are connected."""
        return bool(self._wiring.wires)

    def set_channel(self, channel: int, high: bool) -> None:
        """Set the level of a channel of the analyser that is not on a pin of the chip."""
        self.channels = self.channels & ~(1 << channel) | high << channel

    def supply(self, on: bool) -> None:
        """Switch the supply; when it comes back, the chip starts with the EEPROM that it had."""
        if on and not self._on:
            self._on = True
            self.load(self.contents())
        self._on = on

    def contents(self) -> Image:
        """Return the chip's contents: the image, with the EEPROM as the program has left it."""
        return self.machine.contents()

    def _settle(self) -> None:
        """Let the simulator know the levels from outside that have changed."""
        wanted = dict(self._wiring.held)
        if self._wiring.wires:
            try:
                wanted |= self._wiring.levels(self.machine.levels, self.machine.pull_ups)
            except ShortCircuit:
                wanted |= dict.fromkeys(self._wiring.connected, LOW)
        outside = {pin: level for pin, level in wanted.items() if level != UNDRIVEN}
        if outside != self._outside:
            # All of them: a chip that was taken back has those of then.
            pins = sorted({*outside, *self._outside})
            changes = [LevelChange(self.machine.cycles, pin, outside.get(pin, UNDRIVEN)) for pin in pins]
            (self.debugger or self.machine).apply(changes)
        self._outside = outside

    def _ring(self) -> None:
        """Do what is due now."""
        while self._later and self._later[0][0] <= self.now:
            _, _, pin, level = heappop(self._later)
            self.drive(pin, level)
        for alarm in self.alarms:
            due = alarm.next_at()
            if due is not None and due <= self.now:
                alarm.ring()

    def _next_alarm(self) -> int | None:
        due = [cycle for alarm in self.alarms if (cycle := alarm.next_at()) is not None]
        return min([*due, *(later[0] for later in self._later[:1])], default=None)

    def _levels(self, cycles: int) -> Levels:
        """Run the chip and return the current cycle, those at which levels change, and the levels from each
        on.
        """
        end = self.now + cycles
        pieces: list[Levels] = []
        self._ring()
        while not pieces or (self.now < end and not self._stands):
            due = self._next_alarm()
            goal = end if due is None else min(end, max(due, self.now + 1))
            if self._wiring.wires:
                goal = min(goal, self.now + CONTACT_CYCLES)
            pieces.append(self._piece(goal - self.now))
            if self._wiring.wires:
                self._settle()
            self._ring()
        cycle, level = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        for listener in self.listeners:
            listener((cycle, level), self.now)
        return cycle, level

    def _here(self) -> Levels:
        """Return the levels of this moment."""
        return np.array([self.now], dtype=np.int64), np.array([self.word], dtype=np.uint32)

    def _piece(self, cycles: int) -> Levels:
        """Run the chip while nothing changes outside."""
        begin = self._here()
        if not self._on:
            self._before += cycles
            return begin
        if self._wiring.wires:
            return self._to_change(cycles, begin)
        if self.debugger is not None:
            return self._with_edges(begin, self.debugger.run(cycles, to_edge=False))
        return self._with_edges(begin, join(self.machine.stream(cycles)))

    def _with_edges(self, begin: Levels, chunk: EdgeChunk) -> Levels:
        """Return the levels at the beginning of a run, and from each edge of it on."""
        if not len(chunk.cycle):
            return begin
        word = int(begin[1][0])
        rest = np.array([self._outside.get(pin) == HIGH for pin in range(PAIR_PINS)])
        highs = np.where(chunk.level == UNDRIVEN, rest[chunk.pin], chunk.level == HIGH)
        cycle = np.concatenate((begin[0], chunk.cycle + self._before))
        level = np.full(len(cycle), word & ~sum(1 << pin for pin in self._pins), dtype=np.uint32)
        for pin in self._pins:
            # For each row the row of this pin's latest change, 0 for the level at the beginning: the level
            # from then on.
            own = np.flatnonzero(chunk.pin == pin)
            changes = np.zeros(len(cycle), dtype=np.int64)
            changes[own + 1] = own + 1
            last = np.maximum.accumulate(changes)
            value = np.concatenate([[bool(word >> pin & 1)], highs])[last]
            level |= value.astype(np.uint32) << np.uint32(pin)
        return cycle, level

    def _to_change(self, cycles: int, begin: Levels) -> Levels:
        """Run the chip to the first change of its pins, which what is connected to them follows."""
        if self.debugger is None:
            chunk = self.machine.run_to_change(cycles)
        else:
            chunk = self.debugger.run(cycles, to_edge=True)
        if not len(chunk.cycle):
            return begin
        now = np.array([chunk.cycle[-1] + self._before], dtype=np.int64)
        word = np.array([self.word], dtype=np.uint32)
        return np.concatenate((begin[0], now)), np.concatenate((begin[1], word))


@dataclass(slots=True)
class SecondChip:
    """The second one of two chips on one crystal, for a programmer; it begins anew with the `first`."""

    image: Image
    beside: Callable[[Image, Image, Stimulus | None], PairedMachine]
    """Powers both up: the programs of the first and the second, what is done to the first one's pins."""
    first: VirtualChip | None = None

    def load(self, image: Image) -> None:
        """Load another image and reset both chips."""
        assert self.first is not None
        self.image = image
        self.first.load(self.first.contents())

    def contents(self) -> Image:
        """Return the chip's contents: the image, with the EEPROM as the program has left it."""
        assert self.first is not None and isinstance(self.first.machine, PairedMachine)
        return self.first.machine.other.contents()


@dataclass(slots=True)
class HeldButtons:
    """A stimulus of buttons that are pressed and released while the chip runs.

    At most one of `buttons` is held: the one named `held`, from the next multiple of `cycles` on.
    """

    buttons: Mapping[str, tuple[int, int]]
    """By name: the number of the pin, and its level while the button is pressed."""
    cycles: int
    held: str = ""
    presses: deque[str] = field(default_factory=deque)
    """What is held before that, one name for each multiple of `cycles`."""

    def changes(self, clock: Clock) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        until = 1
        yield until, _packed_changes([LevelChange(0, pin, 1 - level) for pin, level in self.buttons.values()])
        before = ""
        while True:
            now, changes = self.presses.popleft() if self.presses else self.held, []
            if now != before:
                for name in filter(None, (before, now)):
                    pin, level = self.buttons[name]
                    changes.append(LevelChange(until, pin, level if name == now else 1 - level))
            before = now
            until += self.cycles
            yield until, _packed_changes(changes)


def _packed_changes(changes: list[LevelChange]) -> npt.NDArray[np.int64]:
    return np.array([change.packed for change in changes], dtype=np.int64)
