"""`Machine`: a running PIC16F84.

In: an `Image`, a `Clock`, `SimulatorOptions`, optionally a stimulus. Out: edges as they occur, and the
`MachineState` at any time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence, Set
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import tee
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS, UNDRIVEN, EdgeChunk, edge_chunk, join
from servogen.errors import Diagnostic, InputError
from servogen.pic.device import PROGRAM_WORDS, RAM_FIRST, RAM_LAST
from servogen.pic.image import Image
from servogen.simulator import layout as at
from servogen.simulator.core import Loop, loop
from servogen.simulator.devices import Bus, Running
from servogen.simulator.fingerprint import fingerprint, shift, unknown_bits
from servogen.simulator.options import SimulatorOptions
from servogen.simulator.regions import Code, fast_code, marked_code, program_code
from servogen.simulator.reset_state import power_up
from servogen.simulator.sources import LevelChange
from servogen.simulator.state import MachineState, read_unwritten, state_of
from servogen.simulator.warnings import CHIP_DEPENDENT, warnings_of
from servogen.units import Clock, Cycles

EDGE_ROOM = 1 << 16
"""The maximum number of edges in a chunk."""
EDGE_SLACK = 4 * len(PINS)
"""The number of edges that a free run of instructions can add after the buffer was found not full."""

SLICE = 1 << 28
"""The maximum cycles run without returning to Python, so that an interrupt from the keyboard is noticed."""

VISITS = 1 << 11
"""The maximum number of rows that `Machine.visits` yields at once."""

Packed = npt.NDArray[np.int64]


RBPU = 0x80
"""The bit of OPTION_REG that switches the pull-ups off: DS35007 section 2.3.2."""

_COUNTERS = slice(at.OVERFLOWS, at.EDGES_TOTAL + 1)
"""What is counted for reports only."""
_RESTING = (at.AT_END, at.AT_BREAKPOINT)
"""The reasons of the loop's final return."""


@dataclass(frozen=True, slots=True)
class Observation:
    """The output of the observed instruction loop: executions and cycles by address, and the rows of the
    trace.
    """

    counts: Packed = field(default_factory=lambda: np.zeros((PROGRAM_WORDS, 2), dtype=np.int64))
    trace: Packed = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))
    """The buffer for rows of the trace; empty for no trace."""


_UNOBSERVED = Observation(np.zeros((0, 2), dtype=np.int64))


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A machine's complete state at one moment: chip, pending stimulus, edges not yet returned."""

    image: Image
    state: Packed
    stimulus: Packed
    changes: Iterator[tuple[int, Packed]] | None
    """The remaining changes of the stimulus; never advanced itself."""
    edges: Packed
    devices: tuple[Any, ...]
    """The states of the devices on the pins."""


class Stimulus(Protocol):
    """The changes that the outside world applies to the pins."""

    def changes(self, clock: Clock) -> Iterator[tuple[int, Packed]]:
        """Yield the changes piece by piece, in order: (the cycle before which they all lie, cycle << 8 | pin
        << 2 | level).

        Pin 13 is MCLR. Level 2 releases a pin. After the last piece there are no further changes.
        """


class Machine:
    """A chip with a program, from power-up on. Cycle 0 executes the instruction at address 0."""

    def __init__(
        self,
        image: Image,
        clock: Clock,
        options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
        stimulus: Stimulus | None = None,
        *,
        tracked: bool = False,
    ) -> None:
        """Power up the chip. With `tracked`, track values that are undefined at power-up, and warn at their
        first use.

        Tracking is slower, and does not apply to observation.
        """
        self.image = image
        self.clock = clock
        self.options = options
        self.breakpoints: set[int] = set()
        """Addresses before whose instruction `run` and `stream` stop."""
        self.numbers = power_up(image, clock, options, tracked)
        """Everything that the chip consists of, in the order of `layout`; a run goes on from what is here."""
        self._bus = Bus(options.devices, clock)
        self.numbers[at.DEVICES] = self._bus.address
        # Each of them is high by its resistor at first.
        self.numbers[at.DEVICE_PINS] = self.numbers[at.DEVICE_TOLD] = sum(
            1 << pin for pin in options.device_pins
        )
        self._tracked = tracked
        self._plain = program_code(image)
        self._fast = fast_code(self._plain)
        self._marked = frozenset[int](), True, self._fast.code
        """The breakpoints and the kind of the code that ran last, and that code."""
        self.memo = np.full(at.MEMO_ROWS * at.MEMO_COLUMNS, at.UNKNOWN, dtype=np.int64)
        """What regions of the program did, for the next time; -1 where there is nothing yet."""
        self._recording = np.zeros(at.DEEPEST_RECORDING * at.RECORD, dtype=np.int64)
        self._edges = np.zeros(EDGE_ROOM + EDGE_SLACK, dtype=np.int64)
        self.numbers[at.EDGE_LIMIT] = EDGE_ROOM
        self._changes = tee(stimulus.changes(clock), 1)[0] if stimulus else None
        self._stim = np.zeros(0, dtype=np.int64)
        if stimulus:
            self.numbers[at.STIM_KNOWN] = 0
        kept = (self.numbers, self._edges, self._plain, self._fast.regions, self.memo, self._recording)
        self._pointers = tuple(array.ctypes.data for array in kept)
        """Addresses of the arrays that are never replaced: to ask for them takes as long as a short run."""

    @property
    def cycles(self) -> Cycles:
        """Return the cycle in which the next instruction executes."""
        return Cycles(int(self.numbers[at.CYCLE]))

    @property
    def pc(self) -> int:
        """Return the address of the next instruction, 13 bits."""
        return int(self.numbers[at.PC])

    @property
    def edges_made(self) -> int:
        """Return the number of edges since power-up."""
        return int(self.numbers[at.EDGES_TOTAL])

    @property
    def asleep(self) -> bool:
        """Return whether the chip sleeps or is held in reset."""
        return bool(self.numbers[at.SLEEPING] or self.numbers[at.IN_RESET])

    @property
    def ram(self) -> bytes:
        """Return the 68 bytes from 0x0C."""
        return bytes((self.numbers[RAM_FIRST : RAM_LAST + 1] & 0xFF).astype(np.uint8))

    @property
    def pins(self) -> int:
        """Return the level at each pin, driven or read, as a number: bit n is pin n of `PINS`."""
        return int(self.numbers[at.PINS])

    @property
    def levels(self) -> tuple[int, ...]:
        """Return what the chip drives each pin to."""
        driven, high = int(self.numbers[at.DRIVEN]), int(self.numbers[at.DRIVEN_HIGH])
        return tuple(high >> pin & 1 if driven >> pin & 1 else UNDRIVEN for pin in range(len(PINS)))

    @property
    def traced(self) -> tuple[int, ...]:
        """Return the levels that the edges lead to: what the chip drives, and the wires of devices."""
        wires, read = int(self.numbers[at.DEVICE_PINS]), self.pins
        return tuple(read >> pin & 1 if wires >> pin & 1 else level for pin, level in enumerate(self.levels))

    @property
    def devices(self) -> tuple[Running, ...]:
        """Return the devices on the pins as they are now, in the order of the options."""
        return self._bus.devices

    @property
    def pull_ups(self) -> bool:
        """Return whether the pull-ups of port B are on."""
        return not int(self.numbers[at.OPTION]) & RBPU

    def run(self, cycles: int) -> EdgeChunk:
        """Run for `cycles` (the last instruction may end one later) or to a breakpoint, and return the
        edges.
        """
        return join(self.stream(cycles))

    def stream(self, cycles: int) -> Iterator[EdgeChunk]:
        """Run for `cycles`, yielding the edges while it runs, in chunks of bounded size."""
        yield from self._advance(self.cycles + cycles, fast=True)

    def step(self) -> EdgeChunk:
        """Execute one instruction, or let one cycle pass in SLEEP or reset, and return the edges."""
        return join(self._advance(self.cycles + 1, fast=False))

    def run_until(
        self,
        *,
        pc: int | None = None,
        cycle: int | None = None,
        predicate: Callable[[Machine], bool] | None = None,
        limit: int | None = None,
    ) -> bool:
        """Run until the next instruction is at `pc`, or `cycle` is reached, or `predicate` holds between
        instructions; return whether that happened.

        At least one instruction executes. The machine stops after `limit` cycles at the latest. A predicate
        is evaluated after every instruction, which is slow.
        """
        if (pc is None) + (cycle is None) + (predicate is None) != 2:
            raise InputError("conflicting-options", "run_until needs exactly one of pc, cycle and predicate")
        if cycle is not None:
            end = cycle if limit is None else min(cycle, self.cycles + limit)
            for _ in self._advance(max(end, self.cycles), fast=True, breakpoints=frozenset()):
                pass
            return self.cycles >= cycle
        end = at.NEVER if limit is None else self.cycles + limit
        if pc is not None:
            for _ in self._advance(end, fast=True, breakpoints={pc}):
                pass
            return self.pc == pc and self.cycles < end
        while self.cycles < end:
            self.step()
            if predicate is not None and predicate(self):
                return True
        return False

    @property
    def read_unwritten(self) -> tuple[int, ...]:
        """Return the addresses of RAM bytes that were read before they were first written."""
        return read_unwritten(self.numbers)

    @property
    def chip_dependent(self) -> tuple[Diagnostic, ...]:
        """Return the warnings that other chips may behave differently, in order of cycles."""
        return tuple(warning for warning in self._warnings() if warning.code in CHIP_DEPENDENT)

    def state(self) -> MachineState:
        return state_of(self.numbers, self._warnings())

    def _warnings(self) -> tuple[Diagnostic, ...]:
        return warnings_of(self.numbers, self.image, self.clock, remarks=self._bus.remarks)

    def contents(self) -> Image:
        """Return the current contents of the chip: the image, with the EEPROM as the program has left it."""
        return replace(self.image, eeprom=dict(enumerate(self.state().eeprom)))

    def fingerprint(self) -> bytes:
        """Return bytes that are equal for two states of one image, clock and options if both behave
        identically without stimulus.
        """
        return fingerprint(self.numbers) + self._bus.relative(self.cycles)

    def unknown(self) -> bytes:
        """Return the state of unknown values as bytes; if these and the fingerprints are equal, the same uses
        follow.
        """
        return unknown_bits(self.numbers)

    def run_to_edge(self, pin: int, level: int, limit: int) -> Cycles | None:
        """Run until just after the instruction that drives `pin` (its index in `PINS`) to `level`, and return
        the cycle of the edge.

        Returns None if there is no such edge within `limit` cycles. Breakpoints are ignored.
        """
        self.numbers[at.EDGE_LIMIT] = 1  # return after every instruction that makes an edge
        try:
            for chunk in self._advance(self.cycles + limit, fast=True, breakpoints=frozenset()):
                matches = (chunk.pin == pin) & (chunk.level == level)
                if matches.any():
                    return Cycles(int(chunk.cycle[matches][-1]))
        finally:
            self.numbers[at.EDGE_LIMIT] = EDGE_ROOM
        return None

    def run_to_change(self, cycles: int) -> EdgeChunk:
        """Run for `cycles`, or until just after the first instruction that makes an edge; return its edges.

        Breakpoints are ignored.
        """
        self.numbers[at.EDGE_LIMIT] = 1  # return after every instruction that makes an edge
        try:
            chunks = self._advance(self.cycles + cycles, fast=True, breakpoints=frozenset())
            return next((chunk for chunk in chunks if len(chunk.cycle)), join(()))
        finally:
            self.numbers[at.EDGE_LIMIT] = EDGE_ROOM

    def snapshot(self) -> Snapshot:
        """Return the complete state, from which `restore` continues exactly as if nothing had run since.

        Breakpoints and the counts of an observation are not part of it. A stimulus that is generated on
        demand is kept from the oldest snapshot on that is still referenced.
        """
        edges = self._edges[: self.numbers[at.EDGE_COUNT]].copy()
        return Snapshot(
            image=self.image,
            state=self.numbers.copy(),
            stimulus=self._stim,
            changes=copy(self._changes),
            edges=edges,
            devices=self._bus.snapshot(),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a snapshot of this machine, or of another one with the same image, clock and options.

        Raises ValueError if the image is a different one.
        """
        if snapshot.image != self.image:
            raise ValueError("the snapshot is of another image")
        self.numbers[:] = snapshot.state
        self.numbers[at.DEVICES] = self._bus.address
        self._bus.restore(snapshot.devices)
        self._stim = snapshot.stimulus
        self._changes = copy(snapshot.changes)
        self._edges[: len(snapshot.edges)] = snapshot.edges

    def repeat(self, first: Snapshot, second: Snapshot, times: int) -> None:
        """Let the time from `first` to `second` pass `times` more; no edge is returned.

        For a machine that does without end what it did from `first` to `second` (`repeats`), at any moment.
        """
        passed = times * int(second.state[at.CYCLE] - first.state[at.CYCLE])
        self.numbers[_COUNTERS] += times * (second.state[_COUNTERS] - first.state[_COUNTERS])
        shift(self.numbers, passed)

    @staticmethod
    def repeats(first: Snapshot, second: Snapshot) -> bool:
        """Return whether only time tells two moments apart (`recurrence`), and no stimulus is to come.

        With a device on the pins this is not decided.
        """
        last, known = second.state, second.state[at.STIM_KNOWN]
        done = known == at.NEVER and last[at.STIM_NEXT] >= last[at.STIM_COUNT]
        return bool(done) and not second.devices and fingerprint(first.state) == fingerprint(last)

    def poke(self, address: int | None, value: int) -> None:
        """Set a byte of RAM, or W where there is no address, to a known value, as a debugger does."""
        if address is not None and not RAM_FIRST <= address <= RAM_LAST:
            raise ValueError(f"0x{address:02X} is not in RAM")
        if address is None:
            self.numbers[at.W], self.numbers[at.W_UNKNOWN] = value & 0xFF, 0
        else:
            self.numbers[address] = value & 0xFF

    def apply(self, changes: Sequence[LevelChange]) -> None:
        """Add changes from outside to what the stimulus still has to supply, after its own in each cycle.

        Raises ValueError for a change before the current cycle, and for an unknown pin or level.
        """
        for change in changes:
            if change.cycle < self.cycles or not 0 <= change.pin <= at.MCLR_PIN or not 0 <= change.level <= 2:
                raise ValueError(f"{change} cannot be applied in cycle {self.cycles}")
        added = np.array([change.packed for change in changes], dtype=np.int64)
        pieces = [self._stim[self.numbers[at.STIM_NEXT] :]]
        known = int(self.numbers[at.STIM_KNOWN])
        last = max((change.cycle for change in changes), default=0)
        while known <= last:
            known, piece = (
                next(self._changes, (at.NEVER, added[:0])) if self._changes else (at.NEVER, added[:0])
            )
            pieces.append(piece)
        merged = np.concatenate((*pieces, added))
        self._stim = merged[np.argsort(merged >> at.PACK_CYCLE, kind="stable")]
        self.numbers[at.STIM_NEXT], self.numbers[at.STIM_COUNT], self.numbers[at.STIM_KNOWN] = (
            0,
            len(merged),
            known,
        )

    def observe(self, cycles: int, observation: Observation) -> Iterator[tuple[EdgeChunk, Packed]]:
        """Run like `stream`, instruction by instruction, counting in `observation`.

        Yields edges and, if it traces, rows of (cycle, PC, W after, STATUS after), one per instruction.
        """
        end = self.cycles + cycles
        code = marked_code(self._plain, self._plain, self.breakpoints)
        self.numbers[at.TRACE_ROOM] = len(observation.trace)
        for why in self._runs(end, code, loop(observed=True, tracked=False), observation):
            rows = observation.trace[: self.numbers[at.TRACE_COUNT]].copy()
            self.numbers[at.TRACE_COUNT] = 0
            if why in _RESTING or len(rows) or self.numbers[at.EDGE_COUNT]:
                yield self._drain(), rows

    def visits(self, cycles: int) -> Iterator[tuple[EdgeChunk, Packed]]:
        """Run for `cycles` without stopping at breakpoints, but note the state before each instruction there.

        Yields edges and rows of the slots in `layout`, up to `layout.VISIT`; the counters are settled in
        them. A breakpoint at which the run begins is not noted.
        """
        rows = np.zeros((VISITS, at.VISIT), dtype=np.int64)
        end = self.cycles + cycles
        code = marked_code(self._fast.code, self._plain, self.breakpoints)
        self.numbers[at.TRACE_ROOM] = VISITS
        for why in self._runs(end, code, loop(visits=True), Observation(trace=rows)):
            noted = rows[: self.numbers[at.TRACE_COUNT]].copy()
            self.numbers[at.TRACE_COUNT] = 0
            if why in _RESTING or len(noted) or self.numbers[at.EDGE_COUNT]:
                yield self._drain(), noted
        self.numbers[at.TRACE_ROOM] = 0

    def _advance(self, end: int, *, fast: bool, breakpoints: Set[int] | None = None) -> Iterator[EdgeChunk]:
        stops = frozenset(self.breakpoints if breakpoints is None else breakpoints)
        if self._marked[:2] != (stops, fast):  # marking takes as long as running many cycles
            code = marked_code(self._fast.code if fast else self._plain, self._plain, stops)
            self._marked = stops, fast, code
        code = self._marked[2]
        for _ in self._runs(end, code, loop(observed=False, tracked=self._tracked), _UNOBSERVED):
            if self.numbers[at.EDGE_COUNT] or self._bus.changes:
                yield self._drain()

    def _runs(self, end: int, code: Code, run: Loop, observation: Observation) -> Iterator[int]:
        """Call the instruction loop until the end or a breakpoint, yielding the reason of each return."""
        resume = self.cycles
        state, edges, plain, regions, memo, recording = self._pointers
        words, counts, trace = (array.ctypes.data for array in (code, observation.counts, observation.trace))
        while True:
            stop, stimulus = min(end, self.cycles + SLICE), self._stim.ctypes.data
            why = run(
                *(state, stop, edges, stimulus, words, plain, regions, memo, recording),
                *(resume, counts, trace),
            )
            if why == at.AT_END and self.cycles < end:
                continue
            if why == at.NEEDS_STIMULUS:
                self._refill()
                continue
            yield why
            if why in _RESTING:
                return

    def _refill(self) -> None:
        until, changes = next(self._changes, (at.NEVER, None)) if self._changes else (at.NEVER, None)
        self._stim = np.zeros(0, dtype=np.int64) if changes is None else changes
        self.numbers[at.STIM_NEXT] = 0
        self.numbers[at.STIM_COUNT] = len(self._stim)
        self.numbers[at.STIM_KNOWN] = until

    def _drain(self) -> EdgeChunk:
        packed = self._edges[: self.numbers[at.EDGE_COUNT]]
        self.numbers[at.EDGE_COUNT] = 0
        return self._bus.with_wires(unpack_edges(packed))


def unpack_edges(packed: Packed) -> EdgeChunk:
    """Return edges as columns from the packed form that the instruction loop writes."""
    pins = (packed >> at.PACK_PIN) & 0x3F
    return edge_chunk(packed >> at.PACK_CYCLE, pins, packed & at.PACK_LEVELS)
