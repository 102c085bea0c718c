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
from dataclasses import dataclass, field, replace

import numpy as np

from servogen.pic.device import EEPROM_BYTES
from servogen.prove.chip import (
    ALL_UNKNOWN,
    BASE,
    CELL_PHASED,
    FIELD,
    FREE_BYTES,
    TIME_FIELDS,
    UNCERTAIN,
    AbstractChip,
    ChipState,
    Reason,
)
from servogen.prove.forks import Choices, PreparedProgram, before_instruction
from servogen.prove.generalise import Generaliser
from servogen.prove.tables import (
    CLASSES,
    VALUES,
    ByteTable,
    Ints,
    UndecidedTrims,
    Ways,
    WaysMemory,
    spread,
    table_of,
)
from servogen.prove.transitions import Ram, Rest, Transitions, applied
from servogen.prove.trim_pulses import NOT_BEGUN, Position, TrimPulses
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import START_FRAMES
from servogen.simulator import layout

EEDATA = "EEDATA"
Place = int | str
"""A place in the RAM, or EEDATA."""
MAX_TOGETHER = 2
"""Bytes of the EEPROM that may decide together."""
MAX_STEPS = 200_000
CHUNK = 2048
"""Rows that are run at once: each needs 4 KB for a moment."""
FLAGS = layout.T0IF | layout.INTF | layout.RBIF


@dataclass(frozen=True)
class Trimmed:
    """What was proven: each channel's byte of the EEPROM, and how much was run."""

    bytes: dict[int, int]
    """By channel; a channel that has none is not there."""
    runs: int
    frames: int
    written: frozenset[int] = frozenset()
    """Places in the RAM that any run has written."""


@dataclass
class _State:
    """All chips at one address, with the independent bytes of the EEPROM in tables."""

    ram: Ram
    rest: Rest
    tables: dict[Place, ByteTable]
    times: tuple[int, ...]
    """How much later than `rest` says they come, in order; the first is 0."""
    position: Position = NOT_BEGUN
    silent: int = 0
    """How many cuts it has passed before the first pulse."""


@dataclass
class TrimProof:
    """The search, through a program that is proven with the file's EEPROM."""

    program: PreparedProgram
    schedule: PulseSchedule
    transitions: Transitions
    generaliser: Generaliser
    always: frozenset[int]
    """Addresses with ways of their own."""
    rises: frozenset[int]
    """Of the instructions that make the first rise of a slot."""
    phases: int
    """In how many ways TMR0 may begin."""
    chip: AbstractChip
    """With an unknown EEPROM: a byte that is read in another way than by the name of EECON1 is unknown."""
    idle: AbstractChip
    """With NOPs only: what the timers do while time passes."""
    _runs: int = 0
    _written: set[int] = field(default_factory=set)
    _aged: dict[tuple[Rest, int], Rest] = field(default_factory=dict)
    _memories: dict[tuple[object, ...], WaysMemory] = field(default_factory=dict)
    _usual: dict[tuple[int, tuple[int, ...]], set[Place]] = field(default_factory=dict)
    _visited: set[tuple[object, ...]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._pulses = TrimPulses(self.schedule)
        self._timer = self.program.accesses(layout.TMR0_ADDRESS)
        self._reads = self.program.accesses(layout.EEDATA_ADDRESS, writing=True)  # or EECON1
        after = {address + 1 for address in self._reads}
        cuts, entries = self.generaliser.cuts, self.program.entries
        self._stops = frozenset({*self.always, *cuts, *entries, *self.rises, *self._reads, *after})
        self._limit = self.transitions.limit
        self._alone = Transitions(self.chip, self._limit)
        self._alone.stop_at(self._stops)

    def prove(self, starts: Iterable[ChipState]) -> Trimmed:
        """Return what is proven of all runs from `starts`. Raises UndecidedTrims, WrongEdge."""
        waiting = [_State(start.ram, start.rest, tables={}, times=(0,)) for start in starts]
        steps = 0
        while waiting:
            state = waiting.pop()
            steps += 1
            if steps > MAX_STEPS:
                raise UndecidedTrims(f"more than {MAX_STEPS} steps")
            waiting += [settled for following in self._step(state) for settled in self._settled(following)]
        trims = self._pulses.trims
        if len(set(trims.values())) < len(trims):
            raise UndecidedTrims("two channels have their trims in one byte of the EEPROM")
        return Trimmed(trims, self._runs, len(self._pulses.played), frozenset(self._written))

    # from stop to stop

    def _step(self, state: _State) -> list[_State]:
        """Return the states at the next addresses of interest."""
        pc = state.rest[FIELD["PC"]] & 0x3FF
        chip = ChipState(state.ram, state.rest)
        if pc in self.always:
            ways = before_instruction(self.program, chip, frozenset(), self.phases)
            if ways != [()]:
                return [successor for choices in ways for successor in self._each_time(state, choices)]
        if pc in self._reads and self.program.reads_eeprom(chip):
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
            if any(level or state.position.frame >= 0 for _, _, level in outcome.edges):
                raise UndecidedTrims(self._place("a pin changes where TMR0 is read", state))
            tables = {place: table for place, table in state.tables.items() if place not in written}
            ram, after = applied(state.ram, outcome), outcome.rest
            position = self._pulses.later(state.position.moved(late), outcome.cycles)
            arrived = replace(state, ram=ram, rest=after, tables=tables, times=(0,), position=position)
            states.setdefault((ram, after, position), arrived)
        return list(states.values())

    def _eeprom_read(self, state: _State) -> _State:
        """Return the state after the instruction that reads a byte of the EEPROM: it may be any."""
        address = state.rest[FIELD["EEADR"]]
        if state.rest[FIELD["EEADR_UNKNOWN"]] or address >= EEPROM_BYTES:
            raise UndecidedTrims(self._place("the address in the EEPROM is not known", state))
        stops = self._stops | self._timer
        outcome = self.chip.run(ChipState(state.ram, _without_timer(state.rest)), stops, self._limit)
        if outcome.reason is not Reason.STOP or outcome.edges or outcome.written:
            raise UndecidedTrims(self._place("more than a byte of the EEPROM is read", state))
        rest = list(self._at(state, outcome.rest, outcome.cycles))
        rest[FIELD["EEDATA"]], rest[FIELD["EEDATA_UNKNOWN"]] = 0, 0xFF
        tables = {**state.tables, EEDATA: ByteTable((address,), np.arange(VALUES))}
        position = self._pulses.later(state.position, outcome.cycles)
        return replace(state, rest=tuple(rest), tables=tables, position=position)

    def _together(self, state: _State) -> _State:
        """Return where the chips of all times come, which no instruction on the way can tell apart.

        Tables that decide, or are copied, are taken apart.
        """
        # The watchdog's time-out depends on the cycle, which the chips of one state do not share.
        if len(state.times) > 1 and self.chip.watchdog:
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

    def _refined(self, state: _State, arrived: _State, ways: Ways) -> _State:
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

    def _ways(self, state: _State, taken: frozenset[Place]) -> tuple[Ways, Ints, tuple[int, ...]]:
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
        memory = self._memories.setdefault((rest, cells, (*apart,), id(source)), WaysMemory())
        if joint is not None and source is not None and joint.rows is not None:
            classes = joint.rows
            size = len(source.cycles)
        else:
            classes = memory.numbered(cells, apart.values())
            size = CLASSES[len(cells)] ** len(cells)
        ways = memory.found.get(memory.key(state.ram))
        if ways is None:
            ways = memory.found[memory.key(state.ram)] = Ways(state.ram, size)
        if len(ways.row_of) < size:
            more = np.full(size - len(ways.row_of), -1, dtype=np.int32)
            ways.row_of = np.concatenate([ways.row_of, more])
        if ways.fit and (ways.row_of[classes] < 0).any():
            ways = self._run_missing(memory, ways, ChipState(state.ram, rest), classes, cells, apart)
        return ways, ways.row_of[classes].astype(np.int64), cells

    def _run_missing(
        self,
        memory: WaysMemory,
        ways: Ways,
        start: ChipState,
        classes: Ints,
        cells: tuple[int, ...],
        taken: dict[Place, ByteTable],
    ) -> Ways:
        """Run what has not been run of `classes`; return the ways, which others no longer share if they read
        more.
        """
        new, indices = np.unique(classes, return_index=True)
        fresh = ways.row_of[new] < 0
        new, indices = new[fresh], indices[fresh]
        values = np.zeros((len(new), len(taken)), dtype=np.int64)
        for column, table in enumerate(taken.values()):
            values[:, column] = spread(table, cells).ravel()[indices]
        stops, runs = self._stops | self._timer, []
        for begin in range(0, len(new), CHUNK):
            part = slice(begin, begin + CHUNK)
            lanes = self.chip.run_lanes(start, tuple(taken), values[part], stops, self._limit)
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
        self, state: _State, ways: Ways, rows: Ints, cells: tuple[int, ...], taken: frozenset[Place]
    ) -> _State:
        """Return the state at the end of the ways, after a look at their edges."""
        cycles, edges = ways.cycles[rows], {key: column[rows] for key, column in ways.edges.items()}
        first, last = int(cycles.min()), int(cycles.max())
        position = self._pulses.begun(state.position, edges)
        moves = any((column >= 0).any() for column in edges.values())
        if position.frame >= 0 and moves and len(state.times) > 1:
            raise UndecidedTrims(self._place("a pin changes at a time that depends on the EEPROM", state))
        late = last - first + state.times[-1]
        position = self._pulses.after(position, edges, cells, first, late)
        ram, tables = list(state.ram), dict(state.tables)
        new_tables: dict[Place, ByteTable] = {}
        for place, column in ways.ram.items():
            values = column[rows]
            unwritten = values < 0
            if unwritten.all():
                continue
            if unwritten.any():
                before = spread(state.tables[place], cells) if place in taken else np.array(state.ram[place])
                values = np.where(unwritten, before, values)
            tables.pop(place, None)
            ram[place] = int(values.flat[0])
            if (values != ram[place]).any():
                ram[place] = ALL_UNKNOWN
                if (values < VALUES).all():
                    new_tables[place] = table_of(values, cells, ways, rows)
        # Tables of pairs have to come from the same ways, so that the same pair indexes them all.
        if any(table.source is ways for table in new_tables.values()):
            new_tables = {}
            for place in ways.differing():
                new_tables[place] = ByteTable(cells, ways.ram[place][rows], ways, rows)
                tables.pop(place, None)
                ram[place] = ALL_UNKNOWN
        tables |= new_tables
        rest = self._at(state, ways.rest, first)
        later = (np.unique(cycles) - first).tolist()
        times = tuple(sorted({time + more for time in state.times for more in later}))
        return replace(state, ram=tuple(ram), rest=rest, tables=tables, times=times, position=position)

    # time

    def _later(self, state: _State, cycles: int) -> Rest:
        """Return the state beside the RAM after so many cycles in which nothing is executed."""
        if not cycles:
            return state.rest
        key = state.rest, cycles
        later = self._aged.get(key)
        if later is None:
            outcome = self.idle.run(ChipState(state.ram, state.rest), frozenset(), cycles)
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

    def _settled(self, state: _State) -> Iterator[_State]:
        """Yield the state, more general at a cut point, unless it has been there before."""
        if state.rest[FIELD["PC"]] & 0x3FF in self.generaliser.cuts:
            number = self.transitions.number(state.rest)
            ram, general = self.generaliser.generalised(state.ram, number)
            tables = {
                place: table
                for place, table in state.tables.items()
                if place == EEDATA or (ram[int(place)] == ALL_UNKNOWN and not self._dead(state, place))
            }
            state = replace(state, ram=ram, rest=self.transitions.rest(general), tables=tables)
            contents = tuple((place, table.cells, table.values.tobytes()) for place, table in tables.items())
            state = _rephased(state)
            silent = state.silent + 1 if state.position.frame < 0 else 0
            if silent > START_FRAMES:
                raise UndecidedTrims(self._place("no pulse comes", state))
            state.silent = silent
            key = (state.ram, state.rest, state.times, state.position, silent, contents)
            if key in self._visited:
                return
            self._visited.add(key)
        yield state

    def _dead(self, state: _State, place: Place) -> bool:
        return place in self.generaliser.cuts[state.rest[FIELD["PC"]] & 0x3FF].dead

    @staticmethod
    def _place(why: str, state: _State) -> str:
        return f"{why} (address 0x{state.rest[FIELD['PC']] & 0x3FF:03X}, frame {state.position.frame})"


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
