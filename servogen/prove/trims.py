"""The proof for any content of the EEPROM, where a program reads from it the trims of its servos.

In: the program, its schedule, and the cut points of the proof with the file's EEPROM. Out: `TrimResult`:
which byte is the trim of which channel, or the first content with which an edge is not where the schedule and
the trims want it.

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

from servogen.graph import reached
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
    RunMemory,
    RunTable,
    UndecidedTrims,
    broadcast_table,
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
MAX_TOGETHER = 2  # the two pulses of a slot; of three bytes, 2^24 combinations would be run
"""Bytes of the EEPROM that may decide together."""
MAX_STEPS = 200_000
CHUNK = 2048  # 8 MB at a time
"""Rows that are run at once: each needs 4 KB for a moment."""
FLAGS = layout.T0IF | layout.INTF | layout.RBIF


@dataclass(frozen=True)
class TrimResult:
    """What was proven: each channel's byte of the EEPROM, and how much was run."""

    bytes: dict[int, int]
    """By channel; a channel that has none is not there."""
    runs: int
    frames: int
    written: frozenset[int] = frozenset()
    """Places in the RAM that any run has written."""


@dataclass
class _State:
    """All chips at one address; what depends on the EEPROM is in tables (docs/proof.md, "Any trim")."""

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
    """Addresses at which a run forks."""
    rises: frozenset[int]
    """Of the instructions that make the first rise of a slot."""
    phases: int
    """After how many different pauses TMR0 may begin to count."""
    chip: AbstractChip
    """With an unknown EEPROM: a byte that is read in another way than by the name of EECON1 is unknown."""
    idle: AbstractChip
    """With NOPs only: what the timers do while time passes."""
    _runs: int = 0
    _written: set[int] = field(default_factory=set)
    _waited: dict[tuple[Rest, int], Rest] = field(default_factory=dict)
    _memories: dict[tuple[object, ...], RunMemory] = field(default_factory=dict)
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

    def prove(self, starts: Iterable[ChipState]) -> TrimResult:
        """Return what is proven of all runs from `starts`. Raises UndecidedTrims, WrongEdge."""
        states = [_State(start.ram, start.rest, tables={}, times=(0,)) for start in starts]
        # `_followers` leaves out what is known: only states at cut points are compared.
        for steps, _ in enumerate(reached(states, self._followers, is_new=lambda state: True)):
            if steps == MAX_STEPS:
                raise UndecidedTrims(f"more than {MAX_STEPS} steps")
        trims = self._pulses.trims
        if len(set(trims.values())) < len(trims):
            raise UndecidedTrims("two channels have their trims in one byte of the EEPROM")
        return TrimResult(trims, self._runs, len(self._pulses.played), frozenset(self._written))

    # from stop to stop

    def _followers(self, state: _State) -> list[_State]:
        """Return the states at the next addresses of interest that were not there before."""
        return [settled for following in self._step(state) for settled in self._unvisited(following)]

    def _step(self, state: _State) -> list[_State]:
        """Return the states at the next addresses of interest."""
        pc = state.rest[FIELD["PC"]] & 0x3FF
        chip = ChipState(state.ram, state.rest)
        if pc in self.always:
            forks = before_instruction(self.program, chip, frozenset(), self.phases)
            if forks != [()]:
                return [after for choices in forks for after in self._step_each_time(state, choices)]
        if pc in self._reads and self.program.reads_eeprom(chip):
            return [self._eeprom_read(state)]
        if pc in self._timer:
            return self._step_each_time(state, ())
        return [self._step_all_times(state)]

    def _step_each_time(self, state: _State, choices: Choices) -> list[_State]:
        """Return where the chips of each time come, one time after the other."""
        states: dict[tuple[object, ...], _State] = {}
        for late in state.times:
            rest = self._rest_after_waiting(state, late)
            outcome = self._alone.run(state.ram, self._alone.number(rest), choices)
            written = {place for place, _ in outcome.written}
            self._written |= written
            if outcome.reason is not Reason.STOP:
                why = "; ".join(outcome.warnings) or "an unknown bit decides"
                raise UndecidedTrims(self._message(why, state))
            # An interrupt would make the cycle of everything after it depend on the time.
            if outcome.rest[FIELD["INTCON"]] & layout.GIE:
                raise UndecidedTrims(self._message("an interrupt is enabled", state))
            if any(place in state.tables for place in outcome.read):
                raise UndecidedTrims(self._message("what depends on the EEPROM is read beside TMR0", state))
            if any(level or state.position.frame >= 0 for _, _, level in outcome.edges):
                raise UndecidedTrims(self._message("a pin changes where TMR0 is read", state))
            tables = {place: table for place, table in state.tables.items() if place not in written}
            ram, after = applied(state.ram, outcome), outcome.rest
            position = self._pulses.advance(state.position.delayed(late), outcome.cycles)
            arrived = replace(state, ram=ram, rest=after, tables=tables, times=(0,), position=position)
            states.setdefault((ram, after, position), arrived)
        return list(states.values())

    def _eeprom_read(self, state: _State) -> _State:
        """Return the state after the instruction that reads a byte of the EEPROM: it may be any."""
        address = state.rest[FIELD["EEADR"]]
        if state.rest[FIELD["EEADR_UNKNOWN"]] or address >= EEPROM_BYTES:
            raise UndecidedTrims(self._message("the address in the EEPROM is not known", state))
        stops = self._stops | self._timer
        outcome = self.chip.run(ChipState(state.ram, _forget_timer(state.rest)), stops, self._limit)
        if outcome.reason is not Reason.STOP or outcome.edges or outcome.written:
            raise UndecidedTrims(self._message("more than a byte of the EEPROM is read", state))
        rest = list(self._with_time_after(state, outcome.rest, outcome.cycles))
        rest[FIELD["EEDATA"]], rest[FIELD["EEDATA_UNKNOWN"]] = 0, 0xFF
        tables = {**state.tables, EEDATA: ByteTable((address,), np.arange(VALUES))}
        position = self._pulses.advance(state.position, outcome.cycles)
        return replace(state, rest=tuple(rest), tables=tables, position=position)

    def _step_all_times(self, state: _State) -> _State:
        """Return where the chips of all times come, which no instruction on the way can tell apart.

        Where tables decide, each of their values is run: they are `varied`.
        """
        # The watchdog's time-out depends on the cycle, which the chips of one state do not share.
        if len(state.times) > 1 and self.chip.watchdog:
            raise UndecidedTrims("the watchdog is on")
        varied: frozenset[Place] = frozenset()
        # W and the flags rarely matter where tables are varied; with them unknown, more states share the
        # runs. If they decide after all, the exact state is run.
        general = replace(state, rest=_forget_w_and_flags(state.rest))
        while True:
            runs, rows, cells = self._run_table(general if varied else state, varied)
            if varied and (not runs.fit or any((column >= VALUES).any() for column in runs.ram.values())):
                runs, rows, cells = self._run_table(state, varied)
            if runs.fit and runs.same_end:
                arrived = self._state_after(state, runs, rows, cells, varied)
                return self._with_tables_of_copies(state, arrived, runs)
            more = varied | {place for place in runs.read if place in state.tables}
            if more == varied and EEDATA in state.tables:
                more = varied | {EEDATA}
            # Tables with a source hold pairs of values: they are varied together with others of the same
            # source, or not at all.
            joint = next((t.source for t in map(state.tables.get, more) if t is not None and t.source), None)
            more = frozenset(place for place in more if state.tables[place].source is joint)
            # Nothing more can be varied, so what decides is not a byte of the EEPROM.
            if more == varied:
                raise UndecidedTrims(self._message("an unknown bit decides", state))
            varied = more

    def _with_tables_of_copies(self, state: _State, arrived: _State, runs: RunTable) -> _State:
        """Return a state with tables for the bytes that were copied, or computed, from one table without
        deciding anything.
        """
        vague = {p for p in runs.ram if arrived.ram[p] == ALL_UNKNOWN and p not in arrived.tables}
        used: set[Place] = {place for place in runs.read if place in state.tables}
        if not used and EEDATA in state.tables:
            used = {EEDATA}
        ram, tables = list(arrived.ram), dict(arrived.tables)
        for cell in sorted(
            {table.cells[0] for place in used if (table := state.tables[place]).source is None}
        ):
            varied = frozenset(place for place in used if state.tables[place].cells == (cell,))
            if not vague:
                break
            alone, rows, cells = self._run_table(state, varied)
            if not alone.fit or not alone.same_end:
                continue
            for place in sorted(vague & {*alone.ram}):
                values = alone.ram[int(place)][rows]
                if ((values >= 0) & (values < VALUES)).all():
                    vague.discard(place)
                    if (values == values[0]).all():
                        ram[place] = int(values[0])
                    else:
                        tables[place] = ByteTable(cells, values)
        return replace(arrived, ram=tuple(ram), tables=tables)

    def _run_table(self, state: _State, varied: frozenset[Place]) -> tuple[RunTable, Ints, tuple[int, ...]]:
        """Return the runs from a state for each value of the tables of `varied`, the row of each value or
        pair of values, and the bytes of the EEPROM that these are of.
        """
        rest = _forget_timer(state.rest) if len(state.times) > 1 else state.rest
        varied_tables = {place: state.tables[place] for place in sorted(varied, key=str)}
        cells = tuple(sorted({cell for table in varied_tables.values() for cell in table.cells}))
        if len(cells) > MAX_TOGETHER:
            raise UndecidedTrims(self._message(f"{len(cells)} bytes of the EEPROM decide together", state))
        joint = next((table for table in varied_tables.values() if table.source is not None), None)
        source = None if joint is None else joint.source
        if cells and source is None:  # what differs in other frames, too: the same runs serve them all
            usual = self._usual.setdefault((state.rest[FIELD["PC"]], cells), set())
            for place in sorted(usual - {*varied_tables, EEDATA}, key=str):
                if state.ram[int(place)] < VALUES:
                    varied_tables[place] = ByteTable(cells[:1], np.full(VALUES, state.ram[int(place)]))
            usual |= {*varied_tables}
        varied_tables = dict(sorted(varied_tables.items(), key=lambda item: str(item[0])))
        memory = self._memories.setdefault((rest, cells, (*varied_tables,), source), RunMemory())
        if joint is not None and source is not None and joint.rows is not None:
            classes = joint.rows
            size = len(source.cycles)
        else:
            classes = memory.class_numbers(cells, varied_tables.values())
            size = CLASSES[len(cells)] ** len(cells)
        runs = memory.found.get(memory.key(state.ram))
        if runs is None:
            runs = memory.found[memory.key(state.ram)] = RunTable(state.ram, size)
        if len(runs.row_of) < size:
            more = np.full(size - len(runs.row_of), -1, dtype=np.int32)
            runs.row_of = np.concatenate([runs.row_of, more])
        if runs.fit and (runs.row_of[classes] < 0).any():
            runs = self._run_missing(memory, runs, ChipState(state.ram, rest), classes, cells, varied_tables)
        return runs, runs.row_of[classes].astype(np.int64), cells

    def _run_missing(
        self,
        memory: RunMemory,
        runs: RunTable,
        start: ChipState,
        classes: Ints,
        cells: tuple[int, ...],
        varied: dict[Place, ByteTable],
    ) -> RunTable:
        """Run what has not been run of `classes`; return the runs, which others no longer share if they read
        more.
        """
        new, indices = np.unique(classes, return_index=True)
        fresh = runs.row_of[new] < 0
        new, indices = new[fresh], indices[fresh]
        values = np.zeros((len(new), len(varied)), dtype=np.int64)
        for column, table in enumerate(varied.values()):
            values[:, column] = broadcast_table(table, cells).ravel()[indices]
        stops, batches = self._stops | self._timer, []
        for begin in range(0, len(new), CHUNK):
            part = slice(begin, begin + CHUNK)
            lanes = self.chip.run_lanes(start, tuple(varied), values[part], stops, self._limit)
            batches.append((new[part], lanes))
            self._runs += len(values[part])
            if not lanes.fit.all():
                break
        read = {place for _, lanes in batches for place in lanes.read} - {*varied}
        if any(runs.example[place] != start.ram[place] for place in read):
            runs = runs.copied_for(start.ram)
        for numbers, lanes in batches:
            runs.add(numbers, lanes)
        self._written |= {*runs.ram}
        memory.note(frozenset(read))
        memory.found[memory.key(start.ram)] = runs
        return runs

    def _state_after(
        self, state: _State, runs: RunTable, rows: Ints, cells: tuple[int, ...], varied: frozenset[Place]
    ) -> _State:
        """Return the state at the end of the runs, after a look at their edges."""
        cycles, edges = runs.cycles[rows], {key: column[rows] for key, column in runs.edges.items()}
        first, last = int(cycles.min()), int(cycles.max())
        position = self._pulses.first_frame(state.position, edges)
        moves = any((column >= 0).any() for column in edges.values())
        if position.frame >= 0 and moves and len(state.times) > 1:
            raise UndecidedTrims(self._message("a pin changes at a time that depends on the EEPROM", state))
        late = last - first + state.times[-1]
        position = self._pulses.after_edges(position, edges, cells, first, late)
        ram, tables = list(state.ram), dict(state.tables)
        new_tables: dict[Place, ByteTable] = {}
        for place, column in runs.ram.items():
            values = column[rows]
            unwritten = values < 0
            if unwritten.all():
                continue
            if unwritten.any():
                before = (
                    broadcast_table(state.tables[place], cells)
                    if place in varied
                    else np.array(state.ram[place])
                )
                values = np.where(unwritten, before, values)
            tables.pop(place, None)
            ram[place] = int(values.flat[0])
            if (values != ram[place]).any():
                ram[place] = ALL_UNKNOWN
                if (values < VALUES).all():
                    new_tables[place] = table_of(values, cells, runs, rows)
        # Tables of pairs have to come from the same runs, so that the same pair indexes them all.
        if any(table.source is runs for table in new_tables.values()):
            new_tables = {}
            for place in runs.varying_places():
                new_tables[place] = ByteTable(cells, runs.ram[place][rows], runs, rows)
                tables.pop(place, None)
                ram[place] = ALL_UNKNOWN
        tables |= new_tables
        rest = self._with_time_after(state, runs.rest, first)
        later = (np.unique(cycles) - first).tolist()
        times = tuple(sorted({time + more for time in state.times for more in later}))
        return replace(state, ram=tuple(ram), rest=rest, tables=tables, times=times, position=position)

    # time

    def _rest_after_waiting(self, state: _State, cycles: int) -> Rest:
        """Return the state beside the RAM after so many cycles in which nothing is executed."""
        if not cycles:
            return state.rest
        key = state.rest, cycles
        later = self._waited.get(key)
        if later is None:
            outcome = self.idle.run(ChipState(state.ram, state.rest), frozenset(), cycles)
            if outcome.reason is not Reason.LIMIT or outcome.cycles != cycles or outcome.edges:
                raise UndecidedTrims(self._message("something happens by itself", state))
            rest = list(outcome.rest)
            rest[FIELD["PC"]] = state.rest[FIELD["PC"]]
            later = self._waited[key] = tuple(rest)
        return later

    def _with_time_after(self, state: _State, rest: Rest, cycles: int) -> Rest:
        """Return `rest`, but TMR0 as it is `cycles` after `state`."""
        cells, later = list(rest), self._rest_after_waiting(state, cycles)
        for name in TIME_FIELDS:
            cells[FIELD[name]] = later[FIELD[name]]
        cells[FIELD["INTCON"]] &= ~FLAGS
        cells[FIELD["INTCON_UNKNOWN"]] |= FLAGS
        cells[FIELD["RB_OLD"]], cells[FIELD["RB_OLD_UNKNOWN"]] = 0, layout.RB4_TO_7
        if EEDATA in state.tables:
            cells[FIELD["EEDATA"]], cells[FIELD["EEDATA_UNKNOWN"]] = 0, 0xFF
        return tuple(cells)

    def _unvisited(self, state: _State) -> Iterator[_State]:
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
            state = _normalise_phase(state)
            silent = state.silent + 1 if state.position.frame < 0 else 0
            if silent > START_FRAMES:
                raise UndecidedTrims(self._message("no pulse comes", state))
            state.silent = silent
            key = (state.ram, state.rest, state.times, state.position, silent, contents)
            if key in self._visited:
                return
            self._visited.add(key)
        yield state

    def _dead(self, state: _State, place: Place) -> bool:
        return place in self.generaliser.cuts[state.rest[FIELD["PC"]] & 0x3FF].dead

    @staticmethod
    def _message(why: str, state: _State) -> str:
        return f"{why} (address 0x{state.rest[FIELD['PC']] & 0x3FF:03X}, frame {state.position.frame})"


def _normalise_phase(state: _State) -> _State:
    """Return the same state, but φ is the first byte that moves with TMR0: then frames share runs."""
    first = next((cell & 0xFF for cell in state.ram if cell >= CELL_PHASED), 0)
    if not first or state.rest[FIELD["TMR0_UNKNOWN"]] != layout.PHASED:
        return state
    ram = tuple((cell - first & 0xFF) | CELL_PHASED if cell >= CELL_PHASED else cell for cell in state.ram)
    rest = list(state.rest)
    for name in FREE_BYTES:
        if rest[FIELD[UNCERTAIN[name].unknown_name]] == layout.PHASED:
            rest[FIELD[name]] = rest[FIELD[name]] - first & 0xFF
    return replace(state, ram=ram, rest=tuple(rest))


def _forget_w_and_flags(rest: Rest) -> Rest:
    """Return a state beside the RAM in which W and the flags are unknown."""
    cells = list(rest)
    cells[FIELD["W"]], cells[FIELD["W_UNKNOWN"]] = 0, 0xFF
    cells[FIELD["STATUS"]] &= ~7
    cells[FIELD["STATUS_UNKNOWN"]] |= 7
    return tuple(cells)


def _forget_timer(rest: Rest) -> Rest:
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
