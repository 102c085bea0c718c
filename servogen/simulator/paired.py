"""Two chips on one crystal, with a wire from a pin of the first to a pin of the second.

In: a machine that is `shown`, stepped and acted upon, and the `other` one, which keeps up with it. Out: one
machine whose edges are those of both: the other one's pins have numbers from `OTHER_PINS` on.

    shown first     shown ──▶ edges on the wire's pin ──▶ applied to the other one's pin, which runs after it
    shown second    its stimulus is `FirstChip`, a first chip of its own that runs ahead of it; the other one,
                    the same chip, runs after it
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass, fields

import numpy as np

from servogen.edges import HIGH, LOW, OTHER_PINS, UNDRIVEN, EdgeChunk, join, part
from servogen.pic.image import Image
from servogen.simulator.machine import Machine, Observation, Packed, Snapshot, Stimulus
from servogen.simulator.options import SimulatorOptions
from servogen.simulator.sources import LevelChange
from servogen.units import Clock

AHEAD_S = 1
"""The time that a first chip runs ahead at least, so that one without edges does not run for ever."""


@dataclass(frozen=True, slots=True)
class FirstChip:
    """The wire's `pin` of the second chip, driven by pin `source` of the first, with a pull-down."""

    powered: Callable[[], Machine]
    """Returns the first chip at power-up."""
    source: int
    pin: int

    def changes(self, clock: Clock) -> Iterator[LevelChange]:
        first, level = self.powered(), LOW
        while True:
            yield LevelChange(int(first.cycles), self.pin, level)
            for change in _changes(first.run(clock.round_seconds(AHEAD_S)), self.source, self.pin):
                level = change.level
                yield change


def _changes(edges: EdgeChunk, source: int, pin: int) -> Iterator[LevelChange]:
    """Yield what the edges of `source` are at `pin`, which has a pull-down."""
    mine = edges.pin == source
    for cycle, level in zip(edges.cycle[mine].tolist(), edges.level[mine].tolist(), strict=True):
        yield LevelChange(cycle, pin, int(level == HIGH))


@dataclass(frozen=True, slots=True)
class PairedSnapshot(Snapshot):
    """A moment of both chips; that of the other one is `other`."""

    other: Snapshot


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
    ) -> None:
        """Power up the shown chip; `wire` is its pin and the other one's if it is the first, else None."""
        super().__init__(image, clock, options, stimulus)
        self.other = other
        """The chip that is not shown."""
        self._wire = wire
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
        return PairedSnapshot(**kept, other=self.other.snapshot())

    def restore(self, snapshot: Snapshot) -> None:
        assert isinstance(snapshot, PairedSnapshot)
        super().restore(snapshot)
        self.other.restore(snapshot.other)

    def repeat(self, first: Snapshot, second: Snapshot, times: int) -> None:
        assert isinstance(first, PairedSnapshot) and isinstance(second, PairedSnapshot)
        super().repeat(first, second, times)
        self.other.repeat(first.other, second.other, times)

    @staticmethod
    def repeats(first: Snapshot, second: Snapshot) -> bool:
        assert isinstance(first, PairedSnapshot) and isinstance(second, PairedSnapshot)
        return Machine.repeats(first, second) and Machine.repeats(first.other, second.other)

    def observe(self, cycles: int, observation: Observation) -> Iterator[tuple[EdgeChunk, Packed]]:
        for edges, rows in super().observe(cycles, observation):
            yield self._of_both(edges), rows

    def _advance(self, end: int, *, fast: bool, breakpoints: Set[int] | None = None) -> Iterator[EdgeChunk]:
        for edges in super()._advance(end, fast=fast, breakpoints=breakpoints):
            yield self._of_both(edges)
        rest = self._of_both(join(()))
        if len(rest.cycle):
            yield rest

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
