"""Two chips on one crystal, with a wire from a pin of the first to a pin of the second, and one back to MCLR.

In: a machine that is `shown`, stepped and acted upon, and the `other` one, which keeps up with it. Out: one
machine whose edges are those of both: the other one's pins have numbers from `OTHER_PINS` on.

    shown first     shown ──▶ edges on the wire's pin ──▶ applied to the other one's pin, which runs after it
    shown second    its stimulus is `FirstChip`, a first chip of its own that runs ahead of it; the other one,
                    the same chip, runs after it
    restart         where the second chip lets go of its pin, or pulls it low, both go back to that cycle, and
                    on from there with that level at the first one's MCLR
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from itertools import tee

import numpy as np

from servogen.edges import HIGH, LOW, OTHER_PINS, UNDRIVEN, EdgeChunk, join, part
from servogen.pic.image import Image
from servogen.simulator.layout import MCLR_PIN
from servogen.simulator.machine import Machine, Observation, Packed, Snapshot, Stimulus
from servogen.simulator.options import SimulatorOptions
from servogen.simulator.sources import LevelChange
from servogen.units import Clock

NO_ROWS = np.zeros((0, 4), dtype=np.int64)
AHEAD_S = Fraction(1, 10)
"""The time by which a first chip runs ahead of the second one that is shown, whether it has edges or not."""

UNDONE, MOST_UNDONE = 1 << 10, 1 << 22
"""The cycles, at first and at most, that both chips run before a change of the line to MCLR is looked for:
what is made again is not much more than what is kept.
"""


@dataclass(frozen=True, slots=True)
class FirstChip:
    """The wire's `pin` of the second chip, driven by pin `source` of the first, with a pull-down."""

    powered: Callable[[], Machine]
    """Returns the first chip at power-up."""
    source: int
    pin: int

    def changes(self, clock: Clock) -> Iterator[tuple[int, Packed]]:
        first = self.powered()
        piece = [LevelChange(int(first.cycles), self.pin, LOW)]
        while True:
            piece += _changes(first.run(clock.round_seconds(AHEAD_S)), self.source, self.pin)
            yield int(first.cycles), np.array([change.packed for change in piece], dtype=np.int64)
            piece = []


def _changes(edges: EdgeChunk, source: int, pin: int) -> Iterator[LevelChange]:
    """Yield what the edges of `source` are at `pin`, which has a pull-down."""
    mine = edges.pin == source
    for cycle, level in zip(edges.cycle[mine].tolist(), edges.level[mine].tolist(), strict=True):
        yield LevelChange(cycle, pin, int(level == HIGH))


@dataclass(frozen=True, slots=True)
class PairedSnapshot(Snapshot):
    """A moment of both chips; that of the other one is `other`."""

    other: Snapshot
    mclr: int


class PairedMachine(Machine):
    """The chip that is shown, with the other one beside it. Its state, its stops and what is applied to pins
    are the shown one's; its edges and levels are those of both.
    """

    def __init__(
        self,
        image: Image,
        clock: Clock,
        options: SimulatorOptions,
        stimulus: Stimulus | None,
        other: Machine,
        wire: tuple[int, int] | None,
        first: FirstChip,
        restart: int | None = None,
    ) -> None:
        """Power up the shown chip; `wire` is its pin and the other one's if it is the first, else None.

        The pin `restart` of the second chip is wired to the MCLR of the first.
        """
        super().__init__(image, clock, options, stimulus)
        self.other = other
        """The chip that is not shown."""
        self._wire = wire
        self._first = first
        self._restart = None if restart is None else restart + OTHER_PINS * (wire is not None)
        self._mclr = HIGH
        if wire is not None:
            other.apply([LevelChange(0, wire[1], LOW)])

    @property
    def levels(self) -> tuple[int, ...]:
        mine = super().levels
        return (*mine, *[UNDRIVEN] * (OTHER_PINS - len(mine)), *self.other.levels)

    @property
    def pins(self) -> int:
        return super().pins | self.other.pins << OTHER_PINS

    @property
    def edges_made(self) -> int:
        return super().edges_made + self.other.edges_made

    def fingerprint(self) -> bytes:
        return super().fingerprint() + self.other.fingerprint()

    def snapshot(self) -> PairedSnapshot:
        mine = super().snapshot()
        kept = {field.name: getattr(mine, field.name) for field in fields(Snapshot)}
        return PairedSnapshot(**kept, other=self.other.snapshot(), mclr=self._mclr)

    def restore(self, snapshot: Snapshot) -> None:
        assert isinstance(snapshot, PairedSnapshot)
        super().restore(snapshot)
        self.other.restore(snapshot.other)
        self._mclr = snapshot.mclr

    def repeat(self, first: Snapshot, second: Snapshot, times: int) -> None:
        assert isinstance(first, PairedSnapshot) and isinstance(second, PairedSnapshot)
        super().repeat(first, second, times)
        self.other.repeat(first.other, second.other, times)

    @staticmethod
    def repeats(first: Snapshot, second: Snapshot) -> bool:
        assert isinstance(first, PairedSnapshot) and isinstance(second, PairedSnapshot)
        return Machine.repeats(first, second) and Machine.repeats(first.other, second.other)

    def observe(self, cycles: int, observation: Observation) -> Iterator[tuple[EdgeChunk, Packed]]:
        def runs(end: int) -> Iterator[tuple[EdgeChunk, Packed]]:
            for edges, rows in Machine.observe(self, end - self.cycles, observation):
                yield self._of_both(edges), rows

        yield from self._with_line(self.cycles + cycles, runs, self.breakpoints)

    def _advance(self, end: int, *, fast: bool, breakpoints: Set[int] | None = None) -> Iterator[EdgeChunk]:
        def runs(end: int) -> Iterator[tuple[EdgeChunk, Packed]]:
            for edges in Machine._advance(self, end, fast=fast, breakpoints=breakpoints):
                yield self._of_both(edges), NO_ROWS
            rest = self._of_both(join(()))
            if len(rest.cycle):
                yield rest, NO_ROWS

        stops = self.breakpoints if breakpoints is None else breakpoints
        yield from (edges for edges, _ in self._with_line(end, runs, stops))

    def _with_line(
        self, end: int, runs: Callable[[int], Iterator[tuple[EdgeChunk, Packed]]], breakpoints: Set[int]
    ) -> Iterator[tuple[EdgeChunk, Packed]]:
        """Yield what `runs`, to a cycle, yields up to `end`, with the line back to the first chip's MCLR.

        Both chips run without it, for longer and longer; what follows a change of it is made again.
        """
        if self._restart is None:
            yield from runs(end)
            return
        ahead = UNDONE
        while True:
            goal, there = min(end, self.cycles + ahead), None
            running = runs(goal)
            while there is None:
                before = self.snapshot()
                made = next(running, None)
                if made is None:
                    break
                edges = made[0]
                changed = (edges.pin == self._restart) & ((edges.level == LOW) == (self._mclr == HIGH))
                if not changed.any():
                    yield made
                    continue
                self.restore(before)
                goal = there = int(edges.cycle[changed][0])
                yield from runs(there)
            if self.cycles < goal:  # it has stopped before
                return
            if there is not None:
                self._set_mclr(there)
            if self.cycles >= end or (self.pc in breakpoints and not self.asleep):
                return
            ahead = min(2 * ahead, MOST_UNDONE) if there is None else UNDONE

    def _set_mclr(self, cycle: int) -> None:
        """Give the first chip's MCLR its other level."""
        self._mclr = LOW if self._mclr == HIGH else HIGH
        first = self if self._wire is not None else self.other
        change = LevelChange(max(cycle, first.cycles), MCLR_PIN, self._mclr)
        if first is self:
            self.apply([change])
            return
        first.apply([change])
        # What runs ahead of the shown one is now as the other one is.
        ahead = self._first.powered()
        ahead.restore(first.snapshot())
        first_again = replace(self._first, powered=lambda: ahead)
        self._changes = tee(first_again.changes(self.clock), 1)[0]
        self._refill()

    def _of_both(self, edges: EdgeChunk) -> EdgeChunk:
        """Let the other chip keep up, and return its edges among those of the shown one.

        An instruction of two cycles may have taken it a cycle too far; it reads no pin in its second one.
        """
        other = self.other
        if self._wire is not None:
            changes = _changes(edges, *self._wire)
            late = [change._replace(cycle=max(change.cycle, other.cycles)) for change in changes]
            if late:
                other.apply(late)
        if other.cycles >= self.cycles:
            return edges
        theirs = other.run(self.cycles - other.cycles)
        if not len(theirs.cycle):
            return edges
        both = join((edges, theirs._replace(pin=theirs.pin + np.uint8(OTHER_PINS))))
        return part(both, np.argsort(both.cycle, kind="stable"))
