"""`TimeMachine`: a simulated chip that goes to any moment, forwards and backwards.

In: an image with its clock, board and stimulus, and what is done to its pins while it runs. Out: the machine
at the moment that was asked for.

    kept    ●────────●────────●────────●──── …          a snapshot every 20 ms of simulated time
    seek    restores the latest one before the moment and runs from there

Running again from a snapshot repeats what happened, because every change from outside is either part of the
stimulus or in the list of inputs, each of which is applied again in the cycle in which it was first applied.
An input at a moment in the past makes another future: what was known of the old one is dropped.

A program that does the same again and again is not run for hours: once its state has come back, the way to a
far moment goes over whole repetitions at once.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from operator import itemgetter
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from servogen.edges import EdgeChunk, join, part
from servogen.pic.device import PROGRAM_WORDS
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.simulator import LevelChange, Machine, Observation, SimulatorOptions, Snapshot, Stimulus
from servogen.units import Clock, Cycles

SPACING_S = Fraction(20, 1000)
"""The simulated time between two snapshots."""
MAX_SNAPSHOTS = 10_000
"""The maximum number of snapshots, about 5 kB each; beyond it, older ones are thinned out."""
RECENT_S = 20
"""The time before the current moment in which all snapshots are kept."""
ROWS = 1 << 14
"""The number of instructions traced at a time."""
ASLEEP_S = 10
"""The maximum time that a step forwards waits for an instruction: the chip may sleep, or be held in reset."""
LINE_S = 60
"""The maximum time that a step forwards waits for another source line."""
BACK_SNAPSHOTS = 500
"""The maximum number of snapshots that a step back by a line searches."""
NEAR = 3
"""The cycles per instruction by which a step back first goes back."""
NO_LINE = -1
STRIDE_S = Fraction(1)
"""The simulated time of a step on the way to a far moment."""
FAR = 3
"""The number of loops from which on a way is far."""
LOOPS = 1024
"""The maximum number of loops after which a program's state comes back: TMR0 has 256 phases."""
SPARSE = 5000
"""The number of snapshots of a long way."""

Rows = npt.NDArray[np.int64]
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class _Input:
    """Changes that were applied in `cycle`, none of them earlier."""

    cycle: int
    changes: tuple[LevelChange, ...] = ()
    bytes: tuple[tuple[int | None, int], ...] = ()
    """(address in RAM or None for W, value) that a debugger sets."""


@dataclass(frozen=True, slots=True)
class _Kept:
    """A snapshot, and how many of the inputs it knows."""

    snapshot: Snapshot
    inputs: int
    edges: int
    """The number of edges made since power-up."""


@dataclass(frozen=True, slots=True)
class Repetition:
    """What a program does again and again after a number of inputs: from a state until it has come back."""

    begin: int
    length: int
    moments: tuple[tuple[int, Snapshot], ...]
    inputs: int = 0


@dataclass(frozen=True, slots=True)
class Stop:
    """What ended a run early: an edge (pin, level), or, without one, an address."""

    edge: tuple[int, int] | None = None


class TimeMachine:
    """A machine and the way back. A moment is the cycle in which the next instruction executes."""

    def __init__(
        self,
        image: Image,
        clock: Clock,
        options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
        stimulus: Stimulus | None = None,
        listing: Listing | None = None,
        loop: int | None = None,
        machine: Machine | None = None,
        stride_s: Fraction = STRIDE_S,
    ) -> None:
        """Power up the chip; `loop` is the number of cycles after which its program may do the same again.

        `machine` is one at power-up that is not alone: `image`, `options` and `stimulus` are its own.
        `stride_s` is the simulated time of a step on the way to a far moment.
        """
        self.clock = clock
        self.listing = listing
        self.machine = machine or Machine(image, clock, options, stimulus)
        """The chip at the current moment, to be read; only the time machine runs it."""
        self.line_ids, self.lines = _line_ids(listing)
        self._spacing = clock.round_seconds(SPACING_S)
        self._coarse = int(self._spacing)
        self._recent = clock.round_seconds(RECENT_S)
        self._stride = clock.round_seconds(stride_s)
        self._loop = loop
        self.repetition: Repetition | None = None
        """The repetition that was found last, or one that another machine found without inputs."""
        self._inputs: list[_Input] = []
        self._applied = 0
        self._snapshots: dict[int, _Kept] = {}
        self.kept: list[int] = []
        self.reach = Cycles(0)
        """The latest moment that was reached since the last input."""
        self._keep()

    @property
    def now(self) -> Cycles:
        """Return the current moment: the cycle in which the next instruction executes."""
        return self.machine.cycles

    @property
    def inputs(self) -> tuple[LevelChange, ...]:
        """Return the changes of all inputs, in order of cycles."""
        changes = [change for one in self._inputs for change in one.changes]
        return tuple(sorted(changes, key=lambda change: change.cycle))

    @property
    def touched(self) -> float:
        """Return the cycle of the first change from outside; infinite where there is none."""
        if not self._inputs:
            return inf
        first = self._inputs[0]
        return min((change.cycle for change in first.changes), default=first.cycle)

    @property
    def snapshots(self) -> int:
        return len(self.kept)

    def apply(self, changes: Sequence[LevelChange]) -> None:
        """Apply changes from outside, none of them before the current moment, whose old future is dropped."""
        self.machine.apply(changes)
        self._changed(_Input(self.now, tuple(changes)), bisect_right(self.kept, self.now))

    def poke(self, address: int | None, value: int) -> None:
        """Set a byte of RAM, or W where there is no address, now; the old future is dropped."""
        self.machine.poke(address, value)
        self._changed(_Input(self.now, bytes=((address, value),)), bisect_left(self.kept, self.now))
        self._keep()

    def _changed(self, given: _Input, kept: int) -> None:
        """Note what came from outside; only the first `kept` snapshots are still true."""
        now = self.now
        del self._inputs[self._applied :]
        self._inputs.append(given)
        self._applied += 1
        for cycle in self.kept[kept:]:
            del self._snapshots[cycle]
        del self.kept[kept:]
        if self.repetition is not None and self.repetition.begin + self.repetition.length > now:
            self.repetition = None
        self.reach = now

    def seek(self, cycle: int) -> None:
        """Go to the first moment that is not before `cycle`."""
        for _ in self.going(cycle):
            pass

    def going(self, cycle: int) -> Iterator[None]:
        """Go to the first moment that is not before `cycle`, in steps; the way may be left after each."""
        yield from self._nearing(max(0, cycle))
        yield from self._on(max(0, cycle))

    def run(
        self,
        end: int,
        *,
        stops: Set[int] = frozenset(),
        wanted: Callable[[EdgeChunk], npt.NDArray[np.bool_]] | None = None,
        edges: list[EdgeChunk] | None = None,
        toward: int | None = None,
    ) -> Stop | None:
        """Run to the first moment that is not before `end`; return what stopped it earlier, if anything did.

        It stops before an instruction at an address in `stops` (except at the first one), and after an edge
        that `wanted` marks. The edges made are appended to `edges`. Of a way that goes on `toward` a later
        moment fewer snapshots are kept.
        """
        machine, first = self.machine, self.now
        toward = end if toward is None else toward
        machine.breakpoints = set(stops)
        try:
            while True:
                self._arrive(toward)
                if self.now != first and machine.pc in stops and not machine.asleep:
                    return Stop()
                if self.now >= end:
                    return None
                goal = min(end, self._next_due(toward))
                # The core stops at addresses, not at edges: after an edge that is wanted, the stretch is run
                # again up to it.
                begin = machine.snapshot() if wanted is not None else None
                chunk = join(machine.stream(goal - self.now))
                if wanted is not None and begin is not None and len(chunk.cycle):
                    marked = np.flatnonzero(wanted(chunk))
                    if len(marked):
                        first_edge = part(chunk, slice(int(marked[0]), int(marked[0]) + 1))
                        self._after_edge(begin, int(first_edge.cycle[0]), edges)
                        return Stop((int(first_edge.pin[0]), int(first_edge.level[0])))
                if edges is not None:
                    edges.append(chunk)
                if self.now < goal:
                    self._arrive(toward)
                    return Stop()
        finally:
            machine.breakpoints = set()

    def edges(self, begin: int, end: int) -> EdgeChunk:
        """Return the edges of the cycles from `begin` to `end`, and come back to the current moment."""
        here = self.machine.snapshot(), self._applied
        for _ in self._nearing(max(0, begin)):
            pass
        seen: list[EdgeChunk] = []
        self.run(end, edges=seen)
        self.machine.restore(here[0])
        self._applied = here[1]
        chunk = join(seen)
        first, last = np.searchsorted(chunk.cycle, (begin, end))
        return part(chunk, slice(int(first), int(last)))

    def levels_before(self, begin: int) -> tuple[int, ...]:
        """Return the level of each pin before cycle `begin`, and come back to the current moment."""
        return self.at(begin, lambda machine: machine.traced)

    def at(self, cycle: int, read: Callable[[Machine], _T]) -> _T:
        """Return what `read` says of the machine at a moment, and come back to the current one."""
        here = self.machine.snapshot(), self._applied
        self.seek(max(0, cycle))
        said = read(self.machine)
        self.machine.restore(here[0])
        self._applied = here[1]
        return said

    def step(self, instructions: int) -> int:
        """Execute a number of instructions, or go back if it is negative; return the number done.

        Forwards it ends earlier where the chip sleeps on, and backwards at power-up.
        """
        return self._forward(instructions) if instructions >= 0 else self._back(-instructions)

    def step_line(self, forwards: bool) -> bool:
        """Go to the next source line, or back to the beginning of this one or, from there, of the one before.

        Return whether there was one.
        """
        if not self.lines:
            return False
        return self._next_line() if forwards else self._line_before()

    def step_edge(self, forwards: bool, pins: Set[int] = frozenset(), limit: int | None = None) -> bool:
        """Go to just after the next or the previous edge of one of `pins` (none: of any).

        Return whether there is one, forwards within `limit` cycles (default: a minute).
        """

        def wanted(chunk: EdgeChunk) -> npt.NDArray[np.bool_]:
            return np.isin(chunk.pin, list(pins)) if pins else np.ones(len(chunk.pin), dtype=bool)

        if forwards:
            wait = self.clock.round_seconds(LINE_S) if limit is None else limit
            return self.run(self.now + wait, wanted=wanted) is not None
        return self._edge_before(wanted)

    def executed(self, limit: int) -> Rows:
        """Return (cycle, address, W after, STATUS after) of the latest `limit` instructions executed."""
        end = self.now
        here = self.machine.snapshot(), self._applied
        parts: list[Rows] = []
        for rows in self._rows_before(end):
            parts.insert(0, rows)
            if sum(map(len, parts)) >= limit:
                break
        self.machine.restore(here[0])
        self._applied = here[1]
        return np.concatenate(parts)[-limit:] if parts else np.zeros((0, 4), dtype=np.int64)

    def _after_edge(self, begin: Snapshot, cycle: int, edges: list[EdgeChunk] | None) -> None:
        """Go from `begin` to the end of the instruction that makes an edge in `cycle`."""
        self.machine.restore(begin)
        self.machine.breakpoints = set()
        chunk = self.machine.run(cycle + 1 - self.now)
        if edges is not None:
            edges.append(chunk)
        self._arrive(self.now)

    def _next_due(self, end: int) -> int:
        """Return where a run must pause: for an input that is applied again, or for a snapshot."""
        due = self._next_snapshot(end)
        if self._applied < len(self._inputs):
            due = min(due, self._inputs[self._applied].cycle)
        return due

    def _distance(self, end: int) -> int:
        """Return the cycles from one snapshot to the next on the way to `end`."""
        left = end - self.now
        return int(self._spacing if left <= self._recent else max(self._coarse, left // SPARSE))

    def _next_snapshot(self, end: int) -> int:
        spacing = self._distance(end)
        place = bisect_right(self.kept, self.now)
        due = self.kept[place - 1] + spacing
        while place < len(self.kept) and self.kept[place] < due + spacing // 2:
            due = self.kept[place] + spacing
            place += 1
        return max(due, self.now + 1)

    def _arrive(self, end: int) -> None:
        """Apply again the inputs of this moment; keep a snapshot where one is due."""
        while self._applied < len(self._inputs) and self._inputs[self._applied].cycle <= self.now:
            given = self._inputs[self._applied]
            self.machine.apply(given.changes)
            for address, value in given.bytes:
                self.machine.poke(address, value)
            self._applied += 1
        self.reach = max(self.reach, self.now)
        place = bisect_right(self.kept, self.now)
        if self.now - self.kept[place - 1] >= self._distance(end):
            self._keep()

    def _keep(self) -> None:
        now = int(self.now)
        if now in self._snapshots:
            return
        self._snapshots[now] = _Kept(self.machine.snapshot(), self._applied, self.machine.edges_made)
        insort(self.kept, now)
        if len(self.kept) > MAX_SNAPSHOTS:
            self._thin(now)

    def _thin(self, now: int) -> None:
        """Double the distance between the snapshots that are not recent; where the recent ones alone are too
        many, halve the time for which a snapshot is recent.
        """
        limit = MAX_SNAPSHOTS * 3 // 4
        while sum(abs(cycle - now) <= self._recent for cycle in self.kept) >= limit:  # the first one is kept
            self._recent = Cycles(self._recent // 2)
        while len(self.kept) > limit:
            self._coarse *= 2
            last = -self._coarse
            for cycle in list(self.kept):
                if abs(cycle - now) > self._recent and cycle - last < self._coarse:
                    del self._snapshots[cycle]
                else:
                    last = cycle
            self.kept = [cycle for cycle in self.kept if cycle in self._snapshots]

    def _restore(self, place: int) -> None:
        snapshot = self._snapshots[self.kept[place]]
        self.machine.restore(snapshot.snapshot)
        self._applied = snapshot.inputs

    def _restore_before(self, cycle: int) -> None:
        """Restore the latest snapshot that is not after `cycle`, unless the way from here is shorter."""
        place = bisect_right(self.kept, cycle) - 1
        if self.now > cycle or self.kept[place] > self.now:
            self._restore(place)

    def _nearing(self, cycle: int) -> Iterator[None]:
        """Go to a moment that is not after `cycle`, and near it, in steps."""
        self._restore_before(cycle)
        if cycle - self.now > 2 * self._spacing:  # a thinned past, or one that was not run
            yield from self._on(cycle - self._spacing)

    def _on(self, cycle: int) -> Iterator[None]:
        """Run to the first moment that is not before `cycle` in steps, over whole repetitions at once."""
        yield from self._skip_loops(cycle)
        while self.now < cycle:
            self.run(min(cycle, self.now + self._stride), toward=cycle)
            yield

    def _skip_loops(self, cycle: int) -> Iterator[None]:
        """Go on towards a far `cycle`, from loop to loop, until the state has come back; then over whole
        repetitions.
        """
        if self._leap(cycle) or not self._loop:
            return
        length = self._loop * max(1, self.clock.round_seconds(STRIDE_S) // self._loop)
        seen: dict[bytes, int] = {}
        moments: list[tuple[int, Snapshot]] = []
        while self._until_input(cycle) - self.now > FAR * length and len(moments) < LOOPS:
            here = int(self.now), self.machine.snapshot()
            moments.append(here)
            first = seen.setdefault(self.machine.fingerprint(), len(moments) - 1)
            begin, before = moments[first]
            if first < len(moments) - 1 and self.machine.repeats(before, here[1]):
                self.repetition = Repetition(begin, here[0] - begin, tuple(moments[first:]), self._applied)
                break
            end = self.now + length
            while self.now < end:
                self.run(min(end, self.now + self._stride), toward=cycle)
                yield
            if self.now > end:  # not where a loop begins: what was seen is at other places of it
                seen, moments = {}, []
        self._leap(cycle)

    def _leap(self, cycle: int) -> bool:
        """Go over whole repetitions to the nearest known moment that is not after `cycle`, or the next input;
        return whether they are known, and that is nearer than here.
        """
        known = self.repetition
        if known is None or known.inputs > len(self._inputs) or cycle < known.begin + known.length:
            return False
        due = self._inputs[known.inputs].cycle if known.inputs < len(self._inputs) else cycle
        times, phase = divmod(min(cycle, due) - known.begin, known.length)
        at, moment = max(
            (each for each in known.moments[:-1] if each[0] <= known.begin + phase), key=itemgetter(0)
        )
        if not self.now < at + times * known.length <= cycle:
            return False
        self.machine.restore(moment)
        self._applied = known.inputs
        self.machine.repeat(known.moments[0][1], known.moments[-1][1], times)
        self._keep()
        return True

    def _until_input(self, cycle: int) -> int:
        """Return `cycle`, or the next input if that comes first."""
        return min([cycle, *(each.cycle for each in self._inputs[self._applied : self._applied + 1])])

    def _observe(self, end: int, limit: int) -> Rows:
        """Run to `end`, or until `limit` instructions are executed, and return their rows."""
        parts: list[Rows] = []
        left = limit
        while self.now < end and left > 0:
            self._arrive(end)
            goal = min(end, self._next_due(end))
            observation = Observation(trace=np.zeros((min(left, ROWS), 4), dtype=np.int64))
            for _, rows in self.machine.observe(goal - self.now, observation):
                parts.append(rows)
                left -= len(rows)
                if len(rows) == len(observation.trace):
                    break
        self._arrive(self.now)
        return np.concatenate(parts) if parts else np.zeros((0, 4), dtype=np.int64)

    def _forward(self, count: int) -> int:
        return len(self._observe(self.now + self.clock.round_seconds(ASLEEP_S), count))

    def _rows_before(self, end: int) -> Iterator[Rows]:
        """Yield the instructions before `end`, from one snapshot to the next, the latest ones first."""
        while end > 0:
            if end - self.kept[bisect_left(self.kept, end) - 1] > 2 * self._spacing:
                self.seek(end - self._spacing)
            place = bisect_left(self.kept, end) - 1
            begin = self.kept[place]
            self._restore(place)
            yield self._observe(end, end - begin + 1)
            end = begin

    def _back(self, count: int) -> int:
        end = int(self.now)
        begin = end - NEAR - NEAR * count
        if begin > 0:  # most often the instructions take one or two cycles each
            self.seek(begin)
            rows = self._observe(end, end)
            if len(rows) >= count:
                self.seek(int(rows[-count, 0]))
                return count
        left, target = count, 0
        for rows in self._rows_before(end):
            if len(rows) >= left:
                target, left = int(rows[-left, 0]), 0
                break
            left -= len(rows)
        self.seek(target)
        return count - left

    def _next_line(self) -> bool:
        here = self.line_ids[self.machine.pc % PROGRAM_WORDS]
        others = np.flatnonzero((self.line_ids != here) & (self.line_ids != NO_LINE))
        return self.run(self.now + self.clock.round_seconds(LINE_S), stops=set(others.tolist())) is not None

    def _line_before(self) -> bool:
        current: int | None = None
        target = int(self.now)
        for piece, rows in enumerate(self._rows_before(self.now)):
            ids = self.line_ids[rows[:, 1] % PROGRAM_WORDS]
            known = np.flatnonzero(ids != NO_LINE)
            if current is None and len(known):
                current = int(ids[known[-1]])
            others = known[ids[known] != current]
            mine = known[ids[known] == current]
            if len(others):
                later = mine[mine > others[-1]]
                target = int(rows[later[0], 0]) if len(later) else target
                break
            if len(mine):
                target = int(rows[mine[0], 0])
            if piece >= BACK_SNAPSHOTS:
                break
        self.seek(target)
        return current is not None

    def _edge_before(self, wanted: Callable[[EdgeChunk], npt.NDArray[np.bool_]]) -> bool:
        here, end = int(self.now), int(self.now)
        before = self.machine.edges_made
        while end > 0:
            if end - self.kept[bisect_left(self.kept, end) - 1] > FAR * self._coarse:
                self.seek(end - self._stride)  # a past that was not run
            place = bisect_left(self.kept, end) - 1
            while place > 0 and self._snapshots[self.kept[place]].edges >= before:
                place -= 1  # nothing changed since
            begin = self.kept[place]
            self._restore(place)
            seen: list[EdgeChunk] = []
            self.run(end, edges=seen)
            chunk = join(seen)
            for cycle in np.unique(chunk.cycle[wanted(chunk)])[::-1].tolist():
                self.seek(cycle + 1)
                if self.now < here:
                    return True
            end, before = begin, self._snapshots[begin].edges
        self.seek(here)
        return False


def _line_ids(listing: Listing | None) -> tuple[npt.NDArray[np.int64], tuple[tuple[str, int], ...]]:
    """Return, for each address, the number of its source line or NO_LINE; and the lines."""
    ids = np.full(PROGRAM_WORDS, NO_LINE, dtype=np.int64)
    numbers: dict[tuple[str, int], int] = {}
    for row in listing.rows if listing else ():
        if row.file is not None and row.line is not None:
            ids[row.address] = numbers.setdefault((row.file, row.line), len(numbers))
    return ids, tuple(numbers)
