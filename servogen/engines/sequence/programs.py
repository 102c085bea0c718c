"""The `sequence` engine's program as values: frame functions, steps that call them, every delay in cycles.

`Sequence.walk` yields the delays between any two edges, so that the cycles that a compiler's code takes in
addition (`Overheads`) can be measured; the next rendering subtracts them from its delays.

    position(frames)          main
    ┌─ edge, wait, edge …      ┌─ position_1(100), wait
    │  gap                     │  position_2(250), wait
    │  last frame? ── return   │  pause
    └─ again                   └─ …
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from servogen.pulse import PulseSchedule, Run
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class DelayPath:
    """A path through the program from one edge to the next that has its own delay.

    `kind` is "start" (from reset to the first edge), "in" (inside a frame, after its edge `edge`),
    "again" (from a frame to the same frame again), "turn" (from a call of step `owner` to its next call)
    or "after" (from step `owner` to the next one).
    """

    kind: str
    owner: int = 0
    edge: int = 0


START = DelayPath("start")


@dataclass(frozen=True, slots=True)
class Overheads:
    """Cycles by path; a path that was not measured yet costs 0."""

    cycles: Mapping[DelayPath, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cycles", MappingProxyType(dict(self.cycles)))

    def of(self, path: DelayPath) -> int:
        """Return the cycles of a path."""
        return self.cycles.get(path, 0)


@dataclass(frozen=True, slots=True)
class Edge:
    """A port write: `value` goes to port A or B; `channels` are the (channel, level) that it changes."""

    cycle: Cycles
    port: str
    value: int
    changes: tuple[tuple[int, int], ...]
    wait: Cycles
    """The delay after it; the frame's last edge has none."""


@dataclass(frozen=True, slots=True)
class FrameEdges:
    """One frame's edges in order of time."""

    edges: tuple[Edge, ...]
    run: Run

    @property
    def first(self) -> Cycles:
        return self.edges[0].cycle

    @property
    def last(self) -> Cycles:
        return self.edges[-1].cycle


@dataclass(frozen=True, slots=True)
class FrameFunction:
    """A function that repeats one frame."""

    number: int
    frame: FrameEdges
    gap: Cycles
    again: Cycles


@dataclass(frozen=True, slots=True)
class Hold:
    """A step: a position repeated for `frames` frames, or a single frame of its own (`position` None); then
    `after`.

    The step is made `turns` times, with `turn` in place of `after` between two of them.
    """

    number: int
    frame: FrameEdges
    position: FrameFunction | None
    frames: int
    turns: int
    turn: Cycles
    after: Cycles

    @property
    def all_frames(self) -> int:
        """Return the frames of all turns."""
        return self.turns * self.frames


@dataclass(frozen=True, slots=True)
class SilentStep:
    """A step without pulses."""

    frames: int
    wait: Cycles


Step = Hold | SilentStep


@dataclass(frozen=True, slots=True)
class Sequence:
    """The whole program; its first edge comes `start` cycles, plus the overhead of that path, after reset."""

    schedule: PulseSchedule
    start: Cycles
    positions: tuple[FrameFunction, ...]
    lead_in: tuple[Step, ...]
    loop: tuple[Step, ...]

    def walk(self) -> Iterator[tuple[DelayPath, Cycles]]:
        """Yield endlessly, edge by edge, the path that ends in the edge and the requested delays on it."""
        path, asked = START, self.start
        for step in self._steps():
            if isinstance(step, SilentStep):
                asked = Cycles(asked + step.wait)
                continue
            gap = step.position.gap if step.position else Cycles(0)
            for left in reversed(range(step.all_frames)):
                for index, edge in enumerate(step.frame.edges):
                    yield path, asked
                    path, asked = DelayPath("in", _owner(step), index), edge.wait
                if left == 0:
                    path, asked = DelayPath("after", step.number), Cycles(gap + step.after)
                elif left % step.frames == 0:
                    path, asked = DelayPath("turn", step.number), Cycles(gap + step.turn)
                elif step.position:
                    path, asked = DelayPath("again", _owner(step)), Cycles(gap + step.position.again)

    def _steps(self) -> Iterator[Step]:
        yield from self.lead_in
        while any(isinstance(step, Hold) for step in self.loop):
            yield from self.loop


def _owner(step: Hold) -> int:
    """Return the number of a position (from 1), or a negative number for a step with its own frame."""
    return step.position.number if step.position else -step.number
