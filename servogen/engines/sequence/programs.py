"""The `sequence` engine's program as values: frame functions, steps that call them, every delay in cycles.

`Sequence.walk` yields the delays between any two edges, so that the cycles that a compiler's code takes in
addition (`Overheads`) can be measured; the next rendering subtracts them from its delays.

    position(frames)          main                       move(row, rows)
    ┌─ edge, wait, edge …      ┌─ position_1(100), wait    ┌─ edge, wait for a width of this row, edge …
    │  gap                     │  move_1(0, 70), wait      │  gap
    │  last frame? ── return   │  pause                    │  last row? ── return
    └─ again                   └─ …                        └─ next
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from servogen.pulse import PulseSchedule, Run
from servogen.units import Cycles


@dataclass(frozen=True, slots=True)
class DelayPath:
    """A path through the program from one edge to the next that has its own delay.

    `kind` is "start" (from reset to the first edge), "in" (inside a frame, after its edge `edge`),
    "again" (from a frame to the same frame again), "turn" (from a call of step `owner` to its next call),
    "row" (inside a row of table `owner`, after its edge `edge`), "next" (from a row of table `owner` to the
    next one) or "after" (from step `owner` to the next one).
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
        object.__setattr__(self, "cycles", dict(self.cycles))

    def of(self, path: DelayPath) -> int:
        """Return the cycles of a path."""
        return self.cycles.get(path, 0)


@dataclass(frozen=True, slots=True)
class TableDelay:
    """A delay by the table: `offset` plus (`sign` 1) or minus (-1) the width of `channel` in the row."""

    channel: int
    sign: int
    offset: int

    def cycles(self, row: Run) -> Cycles:
        """Return the delay in a row."""
        pulse = row.pulses[self.channel]
        return Cycles(self.offset + self.sign * (pulse.width if pulse else 0))


@dataclass(frozen=True, slots=True)
class Edge:
    """A port write: `value` goes to port A or B; `changes` lists each (channel, level) that it sets."""

    cycle: Cycles
    """Where it is in the frame; of an edge whose place the row tells, the end of the delay after it."""
    port: str
    value: int
    changes: tuple[tuple[int, int], ...]
    wait: Cycles
    """The delay after it; the frame's last edge has none."""
    table: TableDelay | None = None
    """The delay before `wait` that differs from row to row."""


@dataclass(frozen=True, slots=True)
class FrameEdges:
    """One frame's edges in order of time; in a table's frame `run` is its first row."""

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
class WidthTable:
    """The widths of the channels that move, a row for each frame, and the cycles of a turn of the loop that
    waits for them.
    """

    number: int
    rows: tuple[Run, ...]
    channels: tuple[int, ...]
    turn: Cycles

    @property
    def words(self) -> int:
        """Return the words of flash that the widths take."""
        return 2 * len(self.rows) * len(self.channels)

    def longest(self, channel: int) -> Cycles:
        """Return the cycles from a channel's rise to the end of the delay after its fall, in every row."""
        widest = max(pulse.width for row in self.rows if (pulse := row.pulses[channel]))
        return Cycles(widest + self.turn**2)


@dataclass(frozen=True, slots=True)
class RowFunction:
    """A function that plays successive rows of its table, a frame each."""

    table: WidthTable
    frame: FrameEdges
    gap: Cycles
    next: Cycles


@dataclass(frozen=True, slots=True)
class Move:
    """A step: `rows` rows of a table from row `first` on; then `after`."""

    number: int
    function: RowFunction
    first: int
    rows: int
    after: Cycles

    @property
    def played(self) -> tuple[Run, ...]:
        """Return the rows."""
        return self.function.table.rows[self.first : self.first + self.rows]


@dataclass(frozen=True, slots=True)
class SilentStep:
    """A step without pulses."""

    frames: int
    wait: Cycles


Step = Hold | Move | SilentStep


@dataclass(frozen=True, slots=True)
class Sequence:
    """The whole program; its first edge comes `start` cycles, plus the overhead of that path, after reset."""

    schedule: PulseSchedule
    start: Cycles
    positions: tuple[FrameFunction, ...]
    moves: tuple[RowFunction, ...]
    lead_in: tuple[Step, ...]
    loop: tuple[Step, ...]

    def walk(self) -> Iterator[tuple[DelayPath, Cycles]]:
        """Yield endlessly, edge by edge, the path that ends in the edge and the requested delays on it."""
        path, asked = START, self.start
        for step in self._steps():
            if isinstance(step, SilentStep):
                asked = Cycles(asked + step.wait)
                continue
            for following in _row_delays(step) if isinstance(step, Move) else _frame_delays(step):
                yield path, asked
                path, asked = following

    def _steps(self) -> Iterator[Step]:
        yield from self.lead_in
        while any(not isinstance(step, SilentStep) for step in self.loop):
            yield from self.loop


def _frame_delays(step: Hold) -> Iterator[tuple[DelayPath, Cycles]]:
    """Yield for each edge of a step the path that it begins, and the delays on it."""
    gap = step.position.gap if step.position else Cycles(0)
    for left in reversed(range(step.all_frames)):
        for index, edge in enumerate(step.frame.edges[:-1]):
            yield DelayPath("in", _owner(step), index), edge.wait
        if left == 0:
            yield DelayPath("after", step.number), Cycles(gap + step.after)
        elif left % step.frames == 0:
            yield DelayPath("turn", step.number), Cycles(gap + step.turn)
        elif step.position:
            yield DelayPath("again", _owner(step)), Cycles(gap + step.position.again)


def _row_delays(step: Move) -> Iterator[tuple[DelayPath, Cycles]]:
    function, number = step.function, step.function.table.number
    edges = function.frame.edges
    for left, row in zip(reversed(range(step.rows)), step.played, strict=True):
        waits = [edge.wait + (edge.table.cycles(row) if edge.table else 0) for edge in edges]
        for index, wait in enumerate(waits[:-1]):
            yield DelayPath("row", number, index), Cycles(wait)
        if left:
            yield DelayPath("next", number), Cycles(waits[-1] + function.gap + function.next)
        else:
            yield DelayPath("after", step.number), Cycles(waits[-1] + function.gap + step.after)


def _owner(step: Hold) -> int:
    """Return the number of a position (from 1), or a negative number for a step with its own frame."""
    return step.position.number if step.position else -step.number
