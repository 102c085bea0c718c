"""The proof for any content of the EEPROM, where a program reads from it the trims of its servos.

In: the program, its schedule, and the cut points of the proof with the file's EEPROM. Out: `Trimmed`: which
byte is the trim of which channel, or the first content with which an edge is not where the schedule and the
trims want it.

A byte read from the EEPROM has 256 values. What is computed from it is kept as a table, one value for each of
them; whatever else is in a state is the same for all of them. Tables of different bytes are independent: a
state stands for every combination. Where two tables decide together, as the two pulses of a slot do, every
pair of their values is run; a pair that was run before, between the same addresses and with the same bytes
read, is not run again. States that differ only in when they come about are one state with a set of times,
until an instruction reads TMR0.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS
from servogen.engines.stream.protocol import trim_cycles
from servogen.pic.device import EEPROM_BYTES
from servogen.prove.chip import (
    ALL_UNKNOWN,
    BASE,
    CELL_PHASED,
    FIELD,
    FREE_BYTES,
    MERGED,
    TIME_FIELDS,
    UNCERTAIN,
    AbstractChip,
    ChipState,
    Lanes,
    Reason,
)
from servogen.prove.forks import Choices, PreparedProgram, before_instruction
from servogen.prove.generalise import Generaliser
from servogen.prove.specification import START_FRAMES
from servogen.prove.transitions import Ram, Rest, Transitions, applied
from servogen.pulse import PulseSchedule
from servogen.simulator import layout

Ints = npt.NDArray[np.int64]
VALUES = 256
EEDATA = "EEDATA"
NO_BYTE = -1
"""Of a channel whose pulses no trim changes."""
Place = int | str
"""A place in the RAM, or EEDATA."""
MAX_TOGETHER = 2
"""Bytes of the EEPROM that may decide together."""
CLASSES = (1, 1 << 16, 1 << 11)
"""How many different values a byte's tables may have in the ways from one address, alone or in a pair."""
MAX_STEPS = 200_000
CHUNK = 2048
"""Rows that are run at once: each needs 4 KB for a moment."""
FLAGS = layout.T0IF | layout.INTF | layout.RBIF
TRIMS = np.array([trim_cycles(byte) for byte in range(VALUES)], dtype=np.int64)


class UndecidedTrims(Exception):
    """The proof does not reach so far; the text says why."""


@dataclass
class WrongEdge(Exception):
    """An edge that is not where the schedule and the trims want it, and the bytes with which it is there."""

    message: str
    content: dict[int, int]
    frame: int


@dataclass(frozen=True)
class Trimmed:
    """What was proven: each channel's byte of the EEPROM, and how much was run."""

    bytes: dict[int, int]
    """By channel; a channel that has none is not there."""
    runs: int
    frames: int
    written: frozenset[int] = frozenset()
    """Places in the RAM that any run has written."""


@dataclass(frozen=True, eq=False)
class ByteTable:
    """A byte for each value of one byte of the EEPROM, or for each pair of values of two."""

    cells: tuple[int, ...]
    """Which bytes of the EEPROM."""
    values: Ints
    source: _Ways | None = None
    rows: Ints | None = None
    """Of two bytes: the ways that made it, and the number of the way for each pair."""


@dataclass
class _State:
    """All chips at one address, with the independent bytes of the EEPROM in tables."""

    ram: Ram
    rest: Rest
    tables: dict[Place, ByteTable]
    times: tuple[int, ...]
    """How much later than `rest` says they come, in order; the first is 0."""
    frame: int
    """The schedule's frame; -1 before the first pulse."""
    time: int
    """Cycles since its beginning, of the earliest."""
    done: frozenset[int] = frozenset()
    """Channels whose pulse in this frame has been."""
    silent: int = 0
    """How many cuts it has passed before the first pulse."""


class _Ways:
    """The ways from one state, by what tables say: one row for each combination that has been run."""

    def __init__(self, example: Ram, classes: int) -> None:
        self.example = example
        self.row_of = np.full(classes, -1, dtype=np.int32)
        self.read: frozenset[int] = frozenset()
        self.cycles = np.zeros(0, dtype=np.int64)
        self.ram: dict[int, Ints] = {}
        self.edges: dict[tuple[int, int], Ints] = {}
        self.rest: Rest = ()
        self.fit = True
        self.single = True
        """Whether all ways end in the same state, apart from the RAM and the time."""

    def copied(self, example: Ram) -> _Ways:
        """Return the same ways for another RAM, which may have more of its own."""
        other = copy(self)
        other.example, other.row_of = example, self.row_of.copy()
        other.ram, other.edges = dict(self.ram), dict(self.edges)
        return other

    def differing(self) -> list[int]:
        """Return the places in the RAM that all ways write, with known values that are not all the same."""
        return [
            place
            for place, column in self.ram.items()
            if ((column >= 0) & (column < VALUES)).all() and (column != column[0]).any()
        ]

    def add(self, classes: Ints, lanes: Lanes) -> None:
        """Note the ways of `classes`."""
        before = len(self.cycles)
        self.row_of[classes] = before + np.arange(len(classes))
        self.cycles = np.concatenate([self.cycles, lanes.cycles])
        written = {int(place): lanes.ram[:, place] for place in np.flatnonzero((lanes.ram >= 0).any(axis=0))}
        _append(self.ram, written, before, len(classes))
        _append(self.edges, lanes.edges, before, len(classes))
        self.fit = self.fit and bool(lanes.fit.all())
        self.read |= frozenset(lanes.read)
        for rest in lanes.rests:
            self.rest = _joined(self.rest, rest) if self.rest else rest
            self.single = self.single and bool(self.rest)


def _append(
    columns: dict[int, Ints] | dict[tuple[int, int], Ints], new: object, before: int, count: int
) -> None:
    known, added = dict(columns), dict(new)  # type: ignore[call-overload]
    for name in {*known, *added}:
        old = known.get(name, np.full(before, -1, dtype=np.int64))
        more = added.get(name, np.full(count, -1, dtype=np.int64))
        columns[name] = np.concatenate([old, more])


_LOOSE = {FIELD[name] for name in (*TIME_FIELDS, "INTCON", "INTCON_UNKNOWN")}
_BYTES = {FIELD[name]: FIELD[UNCERTAIN[name].unknown_name] for name in MERGED}
_MASKS = {mask: value for value, mask in _BYTES.items()}
_BITS = {FIELD[name]: UNCERTAIN[name].bits for name in MERGED}


def _joined(one: Rest, other: Rest) -> Rest:
    """Return a state beside the RAM that contains both, but for the time; () if they differ in more."""
    if one == other:
        return one
    cells = list(one)
    for number, (a, b) in enumerate(zip(one, other, strict=True)):
        if a == b or number in _LOOSE:
            continue
        if number not in _BYTES and number not in _MASKS:
            return ()
        value, mask = (number, _BYTES[number]) if number in _BYTES else (_MASKS[number], number)
        unknown = (one[mask] | other[mask] | one[value] ^ other[value]) & _BITS[value]
        cells[mask], cells[value] = unknown, one[value] & ~unknown
    return tuple(cells)


@dataclass
class _Memory:
    """The ways from the states that agree in everything that their runs read."""

    read: frozenset[int] = frozenset()
    found: dict[tuple[int, ...], _Ways] = field(default_factory=dict)
    classes: dict[int, dict[bytes, int]] = field(default_factory=dict)
    """By byte of the EEPROM: what its tables say, numbered."""

    def key(self, ram: Ram) -> tuple[int, ...]:
        """Return the cells of the bytes that runs read."""
        return tuple(ram[place] for place in sorted(self.read))

    def note(self, read: frozenset[int]) -> None:
        """Note that runs read more bytes: the remembered ways get longer keys."""
        if not self.read.issuperset(read):
            self.read |= read
            self.found = {self.key(ways.example): ways for ways in self.found.values()}


class TrimProof:
    """The search."""

    def __init__(
        self,
        program: PreparedProgram,
        schedule: PulseSchedule,
        transitions: Transitions,
        generaliser: Generaliser,
        always: frozenset[int],
        rises: frozenset[int],
        phases: int,
        chip: AbstractChip,
        idle: AbstractChip,
    ) -> None:
        """Prepare the proof of a program that is proven with the file's EEPROM.

        `always`: addresses with ways of their own; `rises`: of the instructions that make the first rise of
        a slot; `chip`: with an unknown EEPROM, so that a byte that is read in another way than by the name of
        EECON1 is unknown.
        """
        self._program = program
        self._transitions = transitions
        self._chip = chip
        self._written: set[int] = set()
        self._limit = transitions.limit
        self._generaliser = generaliser
        self._always = always
        self._phases = phases
        self._timer = program.accesses(layout.TMR0_ADDRESS)
        self._reads = program.accesses(layout.EEDATA_ADDRESS, writing=True)  # or EECON1
        after = {address + 1 for address in self._reads}
        self._stops = frozenset({*always, *generaliser.cuts, *program.entries, *rises, *self._reads, *after})
        self._alone = Transitions(self._chip, self._limit)
        self._alone.stop_at(self._stops)
        self._idle = idle
        self._aged: dict[tuple[Rest, int], Rest] = {}
        self._memories: dict[tuple[object, ...], _Memory] = {}
        self._channels = [PINS.index(channel.pin) for channel in schedule.channels]
        self._period = int(schedule.period)
        self._frames = [
            [None if pulse is None else (int(pulse.rise), int(pulse.width)) for pulse in run.pulses]
            for run in (*schedule.lead_in, *schedule.loop)
            for _ in range(run.frames)
        ]
        self._loop = schedule.lead_in_frames
        self._byte_of: dict[int, int] = {}
        self._runs = self._steps = 0
        self._usual: dict[tuple[int, tuple[int, ...]], set[Place]] = {}
        self._visited: set[tuple[object, ...]] = set()
        self._played: set[int] = set()

    def prove(self, starts: Iterable[ChipState]) -> Trimmed:
        """Return what is proven of all runs from `starts`. Raises Undecided, Wrong."""
        waiting = [
            _State(ram=start.ram, rest=start.rest, tables={}, times=(0,), frame=-1, time=0)
            for start in starts
        ]
        while waiting:
            state = waiting.pop()
            self._steps += 1
            if self._steps > MAX_STEPS:
                raise UndecidedTrims(f"more than {MAX_STEPS} steps")
            waiting += [settled for following in self._step(state) for settled in self._settled(following)]
        trims = {channel: byte for channel, byte in self._byte_of.items() if byte != NO_BYTE}
        if len(set(trims.values())) < len(trims):
            raise UndecidedTrims("two channels have their trims in one byte of the EEPROM")
        return Trimmed(trims, self._runs, len(self._played), frozenset(self._written))

    # from stop to stop

    def _step(self, state: _State) -> list[_State]:
        """Return the states at the next addresses of interest."""
        pc = state.rest[FIELD["PC"]] & 0x3FF
        chip = ChipState(state.ram, state.rest)
        if pc in self._always:
            ways = before_instruction(self._program, chip, frozenset(), self._phases)
            if ways != [()]:
                return [successor for choices in ways for successor in self._each_time(state, choices)]
        if pc in self._reads and self._program.reads_eeprom(chip):
            return [self._eeprom_read(state)]
        if pc in self._timer:
            return self._each_time(state, ())
        return [self._together(state)]

    def _each_time(self, state: _State, choices: Choices) -> list[_State]:
        """Return where the chips of each time come, one time after the other."""
        states: dict[tuple[object, ...], _State] = {}
        for late in state.times:
            rest = self._later(state, late)
            outcome = self._alone.run(state.ram, self._alone.number(rest), choices)
            written = {place for place, _ in outcome.written}
            self._written |= written
            if outcome.reason is not Reason.STOP:
                why = "; ".join(outcome.warnings) or "an unknown bit decides"
                raise UndecidedTrims(self._place(why, state))
            # An interrupt would make the cycle of everything after it depend on the time.
            if outcome.rest[FIELD["INTCON"]] & layout.GIE:
                raise UndecidedTrims(self._place("an interrupt is enabled", state))
            if any(place in state.tables for place in outcome.read):
                raise UndecidedTrims(self._place("what depends on the EEPROM is read beside TMR0", state))
            if any(level or state.frame >= 0 for _, _, level in outcome.edges):
                raise UndecidedTrims(self._place("a pin changes where TMR0 is read", state))
            tables = {place: table for place, table in state.tables.items() if place not in written}
            ram, after = applied(state.ram, outcome), outcome.rest
            moved = self._moved(state, state.time + late, outcome.cycles, 0, frozenset())
            one = replace(state, ram=ram, rest=after, tables=tables, times=(0,), **moved)
            states.setdefault((ram, after, one.frame, one.time), one)
        return list(states.values())

    def _eeprom_read(self, state: _State) -> _State:
        """Return the state after the instruction that reads a byte of the EEPROM: it may be any."""
        address = state.rest[FIELD["EEADR"]]
        if state.rest[FIELD["EEADR_UNKNOWN"]] or address >= EEPROM_BYTES:
            raise UndecidedTrims(self._place("the address in the EEPROM is not known", state))
        stops = self._stops | self._timer
        outcome = self._chip.run(ChipState(state.ram, _without_timer(state.rest)), stops, self._limit)
        if outcome.reason is not Reason.STOP or outcome.edges or outcome.written:
            raise UndecidedTrims(self._place("more than a byte of the EEPROM is read", state))
        rest = list(self._at(state, outcome.rest, outcome.cycles))
        rest[FIELD["EEDATA"]], rest[FIELD["EEDATA_UNKNOWN"]] = 0, 0xFF
        tables = {**state.tables, EEDATA: ByteTable((address,), np.arange(VALUES))}
        moved = self._moved(state, state.time, outcome.cycles, 0, frozenset())
        return replace(state, rest=tuple(rest), tables=tables, **moved)

    def _together(self, state: _State) -> _State:
        """Return where the chips of all times come, which no instruction on the way can tell apart.

        Tables that decide, or are copied, are taken apart.
        """
        # The watchdog's time-out depends on the cycle, which the chips of one state do not share.
        if len(state.times) > 1 and self._chip.watchdog:
            raise UndecidedTrims("the watchdog is on")
        taken: frozenset[Place] = frozenset()
        # W and the flags rarely matter where tables are taken apart; with them unknown, more states share the
        # ways. If they decide after all, the ways of the exact state are run.
        general = replace(state, rest=_loosened(state.rest))
        while True:
            ways, rows, cells = self._ways(general if taken else state, taken)
            if taken and (not ways.fit or any((column >= VALUES).any() for column in ways.ram.values())):
                ways, rows, cells = self._ways(state, taken)
            if ways.fit and ways.single:
                arrived = self._arrived(state, ways, rows, cells, taken)
                return self._refined(state, arrived, ways)
            more = taken | {place for place in ways.read if place in state.tables}
            if more == taken and EEDATA in state.tables:
                more = taken | {EEDATA}
            # Tables with a source hold pairs of values: they are taken apart together with others of the same
            # source, or not at all.
            joint = next((t.source for t in map(state.tables.get, more) if t is not None and t.source), None)
            more = frozenset(place for place in more if state.tables[place].source is joint)
            # Nothing more can be taken apart, so what decides is not a byte of the EEPROM.
            if more == taken:
                raise UndecidedTrims(self._place("an unknown bit decides", state))
            taken = more

    def _refined(self, state: _State, arrived: _State, ways: _Ways) -> _State:
        """Return a state with tables for the bytes that were copied, or computed, from one table without
        deciding anything.
        """
        vague = {p for p in ways.ram if arrived.ram[p] == ALL_UNKNOWN and p not in arrived.tables}
        used: set[Place] = {place for place in ways.read if place in state.tables}
        if not used and EEDATA in state.tables:
            used = {EEDATA}
        ram, tables = list(arrived.ram), dict(arrived.tables)
        for cell in sorted(
            {table.cells[0] for place in used if (table := state.tables[place]).source is None}
        ):
            taken = frozenset(place for place in used if state.tables[place].cells == (cell,))
            if not vague:
                break
            one, rows, cells = self._ways(state, taken)
            if not one.fit or not one.single:
                continue
            for place in sorted(vague & {*one.ram}):
                values = one.ram[int(place)][rows]
                if ((values >= 0) & (values < VALUES)).all():
                    vague.discard(place)
                    if (values == values[0]).all():
                        ram[place] = int(values[0])
                    else:
                        tables[place] = ByteTable(cells, values)
        return replace(arrived, ram=tuple(ram), tables=tables)

    def _ways(self, state: _State, taken: frozenset[Place]) -> tuple[_Ways, Ints, tuple[int, ...]]:
        """Return the ways from a state with the tables of `taken` apart, the way of each value or pair of
        values, and the bytes of the EEPROM that these are of.
        """
        rest = _without_timer(state.rest) if len(state.times) > 1 else state.rest
        apart = {place: state.tables[place] for place in sorted(taken, key=str)}
        cells = tuple(sorted({cell for table in apart.values() for cell in table.cells}))
        if len(cells) > MAX_TOGETHER:
            raise UndecidedTrims(self._place(f"{len(cells)} bytes of the EEPROM decide together", state))
        joint = next((table for table in apart.values() if table.source is not None), None)
        source = None if joint is None else joint.source
        if cells and source is None:  # what differs in other frames, too: the same ways serve them all
            usual = self._usual.setdefault((state.rest[FIELD["PC"]], cells), set())
            for place in sorted(usual - {*apart, EEDATA}, key=str):
                if state.ram[int(place)] < VALUES:
                    apart[place] = ByteTable(cells[:1], np.full(VALUES, state.ram[int(place)]))
            usual |= {*apart}
        apart = dict(sorted(apart.items(), key=lambda item: str(item[0])))
        memory = self._memories.setdefault((rest, cells, (*apart,), id(source)), _Memory())
        if joint is not None and source is not None and joint.rows is not None:
            classes = joint.rows
            size = len(source.cycles)
        else:
            classes = self._classes(memory, cells, apart)
            size = CLASSES[len(cells)] ** len(cells)
        ways = memory.found.get(memory.key(state.ram))
        if ways is None:
            ways = memory.found[memory.key(state.ram)] = _Ways(state.ram, size)
        if len(ways.row_of) < size:
            more = np.full(size - len(ways.row_of), -1, dtype=np.int32)
            ways.row_of = np.concatenate([ways.row_of, more])
        if ways.fit and (ways.row_of[classes] < 0).any():
            ways = self._run_missing(memory, ways, ChipState(state.ram, rest), classes, cells, apart)
        return ways, ways.row_of[classes].astype(np.int64), cells

    def _classes(self, memory: _Memory, cells: tuple[int, ...], taken: dict[Place, ByteTable]) -> Ints:
        """Return a number for each value or pair of values, the same where the tables say the same."""
        classes = np.zeros((VALUES,) * len(cells), dtype=np.int64)
        for axis, cell in enumerate(cells):
            columns = [table.values for table in taken.values() if table.cells == (cell,)]
            known = memory.classes.setdefault(cell, {})
            rows = np.stack(columns, axis=1).astype(np.uint8)
            numbers = [known.setdefault(row.tobytes(), len(known)) for row in rows]
            if len(known) > CLASSES[len(cells)]:
                raise UndecidedTrims(f"byte {cell} of the EEPROM makes too many different values")
            classes = classes * CLASSES[len(cells)] + _along(np.array(numbers), axis, len(cells))
        return classes

    def _run_missing(
        self,
        memory: _Memory,
        ways: _Ways,
        start: ChipState,
        classes: Ints,
        cells: tuple[int, ...],
        taken: dict[Place, ByteTable],
    ) -> _Ways:
        """Run what has not been run of `classes`; return the ways, which others no longer share if they read
        more.
        """
        new, indices = np.unique(classes, return_index=True)
        fresh = ways.row_of[new] < 0
        new, indices = new[fresh], indices[fresh]
        values = np.zeros((len(new), len(taken)), dtype=np.int64)
        for column, table in enumerate(taken.values()):
            values[:, column] = _spread(table, cells).ravel()[indices]
        stops, runs = self._stops | self._timer, []
        for begin in range(0, len(new), CHUNK):
            part = slice(begin, begin + CHUNK)
            lanes = self._chip.run_lanes(start, tuple(taken), values[part], stops, self._limit)
            runs.append((new[part], lanes))
            self._runs += len(values[part])
            if not lanes.fit.all():
                break
        read = {place for _, lanes in runs for place in lanes.read} - {*taken}
        if any(ways.example[place] != start.ram[place] for place in read):
            ways = ways.copied(start.ram)
        for numbers, lanes in runs:
            ways.add(numbers, lanes)
        self._written |= {*ways.ram}
        memory.note(frozenset(read))
        memory.found[memory.key(start.ram)] = ways
        return ways

    def _arrived(
        self, state: _State, ways: _Ways, rows: Ints, cells: tuple[int, ...], taken: frozenset[Place]
    ) -> _State:
        """Return the state at the end of the ways, after a look at their edges."""
        cycles = ways.cycles[rows]
        first, last = int(cycles.min()), int(cycles.max())
        moved = self._judged(state, ways, rows, cells, first, last)
        ram, tables = list(state.ram), dict(state.tables)
        new_tables: dict[Place, ByteTable] = {}
        for place, column in ways.ram.items():
            values = column[rows]
            unwritten = values < 0
            if unwritten.all():
                continue
            if unwritten.any():
                before = _spread(state.tables[place], cells) if place in taken else np.array(state.ram[place])
                values = np.where(unwritten, before, values)
            tables.pop(place, None)
            ram[place] = int(values.flat[0])
            if (values != ram[place]).any():
                ram[place] = ALL_UNKNOWN
                if (values < VALUES).all():
                    new_tables[place] = _table(values, cells, ways, rows)
        # Tables of pairs have to come from the same ways, so that the same pair indexes them all.
        if any(table.source is ways for table in new_tables.values()):
            new_tables = {}
            for place in ways.differing():
                new_tables[place] = ByteTable(cells, ways.ram[place][rows], ways, rows)
                tables.pop(place, None)
                ram[place] = ALL_UNKNOWN
        tables |= new_tables
        rest = self._at(state, ways.rest, first)
        late = np.unique(cycles) - first
        times = tuple(sorted({time + more for time in state.times for more in late.tolist()}))
        return replace(state, ram=tuple(ram), rest=rest, tables=tables, times=times, **moved)

    # time

    def _later(self, state: _State, cycles: int) -> Rest:
        """Return the state beside the RAM after so many cycles in which nothing is executed."""
        if not cycles:
            return state.rest
        key = state.rest, cycles
        later = self._aged.get(key)
        if later is None:
            outcome = self._idle.run(ChipState(state.ram, state.rest), frozenset(), cycles)
            if outcome.reason is not Reason.LIMIT or outcome.cycles != cycles or outcome.edges:
                raise UndecidedTrims(self._place("something happens by itself", state))
            rest = list(outcome.rest)
            rest[FIELD["PC"]] = state.rest[FIELD["PC"]]
            later = self._aged[key] = tuple(rest)
        return later

    def _at(self, state: _State, rest: Rest, cycles: int) -> Rest:
        """Return `rest`, but TMR0 as it is `cycles` after `state`."""
        cells, later = list(rest), self._later(state, cycles)
        for name in TIME_FIELDS:
            cells[FIELD[name]] = later[FIELD[name]]
        cells[FIELD["INTCON"]] &= ~FLAGS
        cells[FIELD["INTCON_UNKNOWN"]] |= FLAGS
        cells[FIELD["RB_OLD"]], cells[FIELD["RB_OLD_UNKNOWN"]] = 0, layout.RB4_TO_7
        if EEDATA in state.tables:
            cells[FIELD["EEDATA"]], cells[FIELD["EEDATA_UNKNOWN"]] = 0, 0xFF
        return tuple(cells)

    # edges

    def _judged(
        self, state: _State, ways: _Ways, rows: Ints, cells: tuple[int, ...], first: int, last: int
    ) -> dict[str, Any]:
        """Return the place in the schedule after the ways, of `first` to `last` cycles. Raises Wrong."""
        edges = {key: column[rows] for key, column in ways.edges.items()}
        rises = {pin: column for (pin, level), column in edges.items() if level and (column >= 0).any()}
        pins = {pin for (pin, _), column in edges.items() if (column >= 0).any()}
        start = state
        if state.frame < 0 and rises:
            beginning = min(int(column[column >= 0].min()) for column in rises.values())
            frame = next(n for n, pulses in enumerate(self._frames) if any(pulses))
            offset = min(pulse[0] for pulse in self._frames[frame] if pulse)
            start = replace(state, frame=frame, time=offset - beginning)
        elif state.frame < 0:
            return {}
        if pins and len(state.times) > 1:
            raise UndecidedTrims(self._place("a pin changes at a time that depends on the EEPROM", state))
        matched = set()
        due = {(pin, rise): (ahead, channel, width) for ahead, channel, pin, rise, width in self._due(start)}
        for pin in sorted(pins):
            rise = rises.get(pin)
            fall = edges.get((pin, 0))
            rise_cycle = int(rise.flat[0]) if rise is not None else -1
            pulse = due.get((pin, start.time + rise_cycle))
            if rise is None or fall is None or pulse is None or (rise != rise_cycle).any():
                other = int(np.argmax(rise != rise_cycle)) if rise is not None else 0
                message = f"a pulse on {PINS[pin]} is not the schedule's"
                raise WrongEdge(message, self._content(cells, other), start.frame)
            ahead, channel, width = pulse
            self._compare(channel, fall - rise_cycle - width, cells, start.frame + ahead)
            matched.add((ahead, channel))
        return self._moved(start, start.time, first, last - first + state.times[-1], frozenset(matched))

    def _compare(self, channel: int, longer: Ints, cells: tuple[int, ...], frame: int) -> None:
        """Compare by how much pulses are longer than planned with the trims. Raises Wrong."""
        known = self._byte_of.get(channel)
        differs = {NO_BYTE: longer != 0}
        for axis, cell in enumerate(cells):
            differs[cell] = longer != _along(TRIMS, axis, len(cells))
        pin = PINS[self._channels[channel]]
        message = f"the fall of {pin} is not where the EEPROM wants it"
        if known is not None and known not in differs:
            raise WrongEdge(
                message, {known: 1}, frame
            )  # the length of this pulse does not depend on its byte
        # The first pulse of a channel shows which byte is its trim: the one that explains most lengths. From
        # then on the channel keeps that byte.
        options = [known] if known is not None else [*differs]
        fewest, cell = min((int(np.count_nonzero(differs[option])), option) for option in options)
        wrong = differs[cell]
        if fewest:
            raise WrongEdge(message, self._content(cells, int(np.argmax(wrong))), frame)
        self._byte_of[channel] = cell

    @staticmethod
    def _content(cells: tuple[int, ...], index: int) -> dict[int, int]:
        """Return the bytes of the EEPROM that a pair, or a value, stands for."""
        values = np.unravel_index(index, (VALUES,) * len(cells)) if cells else ()
        return {cell: int(value) for cell, value in zip(cells, values, strict=True)}

    def _due(self, state: _State) -> Iterator[tuple[int, int, int, int, int]]:
        """Yield the pulses of this frame that have not been, and of the next: (frames ahead, channel, pin,
        rise, width).
        """
        for ahead, frame in enumerate((state.frame, self._following(state.frame))):
            for channel, pulse in enumerate(self._frames[frame]):
                if pulse is not None and (ahead or channel not in state.done):
                    yield ahead, channel, self._channels[channel], pulse[0] + ahead * self._period, pulse[1]

    def _following(self, frame: int) -> int:
        return frame + 1 if frame + 1 < len(self._frames) else self._loop

    def _moved(
        self, state: _State, time: int, first: int, spread: int, matched: frozenset[tuple[int, int]]
    ) -> dict[str, Any]:
        """Return the place in the schedule `first` cycles after `time`, for the earliest chip; the latest is
        `spread` cycles behind. No pulse may be due meanwhile but those that came. Raises Wrong.
        """
        if state.frame < 0:
            return {}
        frame, end = state.frame, time + first
        for ahead, channel, pin, rise, _ in self._due(state):
            if rise < end + spread and (ahead, channel) not in matched:
                raise WrongEdge(f"the rise of {PINS[pin]} is missing", {}, frame)
        pulsed = state.done | {channel for ahead, channel in matched if not ahead}
        ahead_done = frozenset(channel for ahead, channel in matched if ahead)
        while end >= self._period:
            self._played.add(frame)
            frame, end, pulsed, ahead_done = (
                self._following(frame),
                end - self._period,
                ahead_done,
                frozenset(),
            )
        return {"frame": frame, "time": end, "done": frozenset(pulsed)}

    def _settled(self, state: _State) -> Iterator[_State]:
        """Yield the state, more general at a cut point, unless it has been there before."""
        if state.rest[FIELD["PC"]] & 0x3FF in self._generaliser.cuts:
            number = self._transitions.number(state.rest)
            ram, general = self._generaliser.generalised(state.ram, number)
            tables = {
                place: table
                for place, table in state.tables.items()
                if place == EEDATA or (ram[int(place)] == ALL_UNKNOWN and not self._dead(state, place))
            }
            state = replace(state, ram=ram, rest=self._transitions.rest(general), tables=tables)
            contents = tuple((place, table.cells, table.values.tobytes()) for place, table in tables.items())
            state = _rephased(state)
            silent = state.silent + 1 if state.frame < 0 else 0
            if silent > START_FRAMES:
                raise UndecidedTrims(self._place("no pulse comes", state))
            state.silent = silent
            key = (state.ram, state.rest, state.times, state.frame, state.time, state.done, silent, contents)
            if key in self._visited:
                return
            self._visited.add(key)
        yield state

    def _dead(self, state: _State, place: Place) -> bool:
        return place in self._generaliser.cuts[state.rest[FIELD["PC"]] & 0x3FF].dead

    @staticmethod
    def _place(why: str, state: _State) -> str:
        return f"{why} (address 0x{state.rest[FIELD['PC']] & 0x3FF:03X}, frame {state.frame})"


def _rephased(state: _State) -> _State:
    """Return the same state, but φ is the first byte that moves with TMR0: then frames share ways."""
    first = next((cell & 0xFF for cell in state.ram if cell >= CELL_PHASED), 0)
    if not first or state.rest[FIELD["TMR0_UNKNOWN"]] != layout.PHASED:
        return state
    ram = tuple((cell - first & 0xFF) | CELL_PHASED if cell >= CELL_PHASED else cell for cell in state.ram)
    rest = list(state.rest)
    for name in FREE_BYTES:
        if rest[FIELD[UNCERTAIN[name].unknown_name]] == layout.PHASED:
            rest[FIELD[name]] = rest[FIELD[name]] - first & 0xFF
    return replace(state, ram=ram, rest=tuple(rest))


def _loosened(rest: Rest) -> Rest:
    """Return a state beside the RAM in which W and the flags are unknown."""
    cells = list(rest)
    cells[FIELD["W"]], cells[FIELD["W_UNKNOWN"]] = 0, 0xFF
    cells[FIELD["STATUS"]] &= ~7
    cells[FIELD["STATUS_UNKNOWN"]] |= 7
    return tuple(cells)


def _without_timer(rest: Rest) -> Rest:
    """Return a state beside the RAM in which nothing is known of TMR0."""
    cells = list(rest)
    for name, value in (
        ("TMR0", 0), ("TMR0_UNKNOWN", 0xFF), ("T0_AT", BASE), ("T0_HELD", BASE), ("T0_FLAGGED", -1),
        ("PRESCALER", 0), ("PRESCALER_UNKNOWN", 0xFF),
    ):  # fmt: skip
        cells[FIELD[name]] = value
    cells[FIELD["INTCON"]] &= ~FLAGS
    cells[FIELD["INTCON_UNKNOWN"]] |= FLAGS
    return tuple(cells)


def _along(values: Ints, axis: int, axes: int) -> Ints:
    """Return values that belong to one of several bytes, for all their combinations."""
    shape = [1] * axes
    shape[axis] = VALUES
    return np.broadcast_to(values.reshape(shape), (VALUES,) * axes)


def _spread(table: ByteTable, cells: tuple[int, ...]) -> Ints:
    """Return what a table says for each combination of the values of `cells`."""
    if table.cells == cells:
        return table.values
    return _along(table.values, cells.index(table.cells[0]), len(cells))


def _table(values: Ints, cells: tuple[int, ...], ways: _Ways, rows: Ints) -> ByteTable:
    """Return the table of a byte, of one byte of the EEPROM if it is enough."""
    if len(cells) == 1:
        return ByteTable(cells, values)
    if (values == values[:, :1]).all():
        return ByteTable(cells[:1], values[:, 0])
    if (values == values[:1]).all():
        return ByteTable(cells[1:], values[0])
    return ByteTable(cells, values, ways, rows)
