"""The proof for any content of the EEPROM, where a program reads from it the trims of its servos.

In: the program, its schedule, and the cut points of the proof with the file's EEPROM. Out: `TrimResult`:
which byte is the trim of which channel, or the first content with which an edge is not where the schedule and
the trims want it.

It quantifies over every content of the EEPROM, and over every chip and reset that the proof with the file's
does. A step takes all chips of a state (`trim_states`) to the next stop. Where its tables decide, it is a
case split over bytes of the EEPROM (`table_runs`), and afterwards the chips are joined to one state with a
set of times; each time is followed alone where TMR0 is accessed. The edges are compared for every content. At
a cut, a state that was there before is not followed again. So when no state is left, every run has been
covered.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from servogen.graph import reached
from servogen.pic.device import EEPROM_BYTES
from servogen.prove.chip import FIELD, AbstractChip, ChipState, Reason
from servogen.prove.forks import Choices, PreparedProgram, before_instruction
from servogen.prove.generalise import Generaliser
from servogen.prove.table_runs import SplitRuns, TableRunner
from servogen.prove.tables import EEDATA, VALUES, ByteTable, Place, UndecidedTrims, addresses_of, pairing_of
from servogen.prove.transitions import Transitions, applied
from servogen.prove.trim_pulses import TrimPulses
from servogen.prove.trim_states import TrimState
from servogen.prove.trim_time import PassingTime, at_any_time, unknown
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import START_FRAMES
from servogen.simulator import layout

MAX_TOGETHER = 2  # the two pulses of a slot; of three bytes, 2^24 combinations would be run
"""Bytes of the EEPROM that may decide together."""
MAX_STEPS = 200_000


@dataclass(frozen=True)
class TrimResult:
    """What was proven: each channel's byte of the EEPROM, and how much was run."""

    bytes: dict[int, int]
    """By channel; a channel that has none is not there."""
    runs: int
    frames: int
    written: frozenset[int] = frozenset()
    """Places in the RAM that any run has written."""


class TrimProof:
    """The search, through a program that is proven with the file's EEPROM."""

    def __init__(
        self,
        program: PreparedProgram,
        schedule: PulseSchedule,
        generaliser: Generaliser,
        chip: AbstractChip,
        idle: AbstractChip,
        *,
        always: frozenset[int],
        rises: frozenset[int],
        phases: int,
        limit: int,
    ) -> None:
        """Prepare.

        `chip` has an unknown EEPROM: a byte that is read in another way than by the name of EECON1 is
        unknown. The program of `idle` is NOPs. A run forks at the addresses in `always`; `rises` are those of
        the instructions that make the first rise of a slot. TMR0 may begin to count after `phases` different
        pauses. No run between stops is longer than `limit` cycles.
        """
        self._program, self._generaliser, self._chip = program, generaliser, chip
        self._always, self._phases = always, phases
        self._timer = program.accesses(layout.TMR0_ADDRESS)
        self._reads = program.accesses(layout.EEDATA_ADDRESS, writing=True)  # or EECON1
        after = {address + 1 for address in self._reads}
        stops = frozenset({*always, *generaliser.cuts, *program.entries, *rises, *self._reads, *after})
        self._pulses, self._time = TrimPulses(schedule), PassingTime(idle)
        self._runner = TableRunner(chip, stops | self._timer, limit)
        self._alone = Transitions(chip, limit)
        self._alone.stop_at(stops)
        self._visited: set[object] = set()

    def prove(self, starts: Iterable[ChipState]) -> TrimResult:
        """Return what is proven of all runs from `starts`. Raises UndecidedTrims, WrongEdge."""
        states = [TrimState(start.ram, start.rest) for start in starts]
        for steps, _ in enumerate(reached(states, self._followers, self._is_new)):
            if steps == MAX_STEPS:
                raise UndecidedTrims(f"more than {MAX_STEPS} steps")
        trims = self._pulses.trims
        if len(set(trims.values())) < len(trims):
            raise UndecidedTrims("two channels have their trims in one byte of the EEPROM")
        written = frozenset(self._runner.written | self._alone.written)
        return TrimResult(trims, self._runner.count, len(self._pulses.played), written)

    # from stop to stop

    def _is_new(self, state: TrimState) -> bool:
        """Return whether a state is to be followed: at a cut only if it has not been there."""
        if state.pc not in self._generaliser.cuts:
            return True
        count = len(self._visited)
        self._visited.add(state.key)
        return len(self._visited) > count

    def _followers(self, state: TrimState) -> list[TrimState]:
        """Return the states at the next stops, general at cut points."""
        return [self._generalised(after) for after in self._step(state)]

    def _generalised(self, state: TrimState) -> TrimState:
        guess = self._generaliser.cuts.get(state.pc)
        if guess is None:
            return state
        silent = state.silent + 1 if state.position.frame < 0 else 0
        if silent > START_FRAMES:
            raise state.undecided("no pulse comes")
        general = self._generaliser.covering(state.chip)
        tables = {place: table for place, table in state.tables.items() if place not in guess.dead}
        after = replace(state, ram=general.ram, rest=general.rest, tables=tables, silent=silent)
        return after.with_own_phase()

    def _step(self, state: TrimState) -> list[TrimState]:
        """Return the states at the next stops."""
        if state.pc in self._always:
            forks = before_instruction(self._program, state.chip, frozenset(), self._phases)
            if forks != [()]:
                return [after for choices in forks for after in self._step_each_time(state, choices)]
        if state.pc in self._reads and self._program.reads_eeprom(state.chip):
            return [self._step_of_read(state)]
        if state.pc in self._timer:
            return self._step_each_time(state, ())
        return [self._step_all_times(state)]

    def _step_each_time(self, state: TrimState, choices: Choices) -> list[TrimState]:
        """Return where the chips of each time come, one time after the other."""
        states: dict[object, TrimState] = {}
        for late in state.times:
            rest = self._time.after(state, late)
            outcome = self._alone.run(state.ram, self._alone.number(rest), choices)
            if outcome.reason is not Reason.STOP:
                raise state.undecided("; ".join(outcome.warnings) or "an unknown bit decides")
            # An interrupt would make the cycle of everything after it depend on the time.
            if outcome.rest[FIELD["INTCON"]] & layout.GIE:
                raise state.undecided("an interrupt is enabled")
            if any(place in state.tables for place in outcome.read):
                raise state.undecided("what depends on the EEPROM is read beside TMR0")
            if any(level or state.position.frame >= 0 for _, _, level in outcome.edges):
                raise state.undecided("a pin changes where TMR0 is read")
            # What is written has no table any more; nor has EEDATA, which an access through FSR may change.
            gone = {EEDATA, *(place for place, _ in outcome.written)}
            arrived = replace(
                state,
                ram=applied(state.ram, outcome),
                rest=outcome.rest,
                tables={place: table for place, table in state.tables.items() if place not in gone},
                times=(0,),
                position=self._pulses.advance(state.position.delayed(late), outcome.cycles),
            )
            same = arrived.ram, arrived.rest, arrived.position, frozenset(arrived.tables)
            states.setdefault(same, arrived)
        return list(states.values())

    def _step_of_read(self, state: TrimState) -> TrimState:
        """Return the state after the instruction that reads a byte of the EEPROM: it may be any."""
        address = state.rest[FIELD["EEADR"]]
        if state.rest[FIELD["EEADR_UNKNOWN"]] or address >= EEPROM_BYTES:
            raise state.undecided("the address in the EEPROM is not known")
        outcome = self._alone.run(state.ram, self._alone.number(at_any_time(state.rest)), ())
        if outcome.reason is not Reason.STOP or outcome.edges or outcome.written:
            raise state.undecided("more than a byte of the EEPROM is read")
        position = self._pulses.advance(state.position, outcome.cycles)
        rest = self._time.with_time_after(state, outcome.cycles, unknown(outcome.rest, EEDATA=0xFF))
        tables = {**state.tables, EEDATA: ByteTable((address,), np.arange(VALUES))}
        return replace(state, rest=rest, tables=tables, position=position)

    def _step_all_times(self, state: TrimState) -> TrimState:
        """Return where the chips of all times come, which no instruction on the way can tell apart."""
        # The watchdog's time-out depends on the cycle, which the chips of one state do not share.
        if len(state.times) > 1 and self._chip.watchdog:
            raise UndecidedTrims("the watchdog is on")
        split: frozenset[Place] = frozenset()
        while True:
            runs = self._decided(state, split)
            if runs.joinable:
                return self._with_copies(state, self._joined(state, runs), runs)
            split = _finer(state, split, runs.table.read)

    def _decided(self, state: TrimState, split: frozenset[Place]) -> SplitRuns:
        """Return the runs from a state with some places split, from fewer of its W and flags if they do not
        matter.
        """
        if split:  # W and the flags rarely matter then; with them unknown, more states share the runs
            rest = unknown(state.rest, W=0xFF, STATUS=layout.C_DC_Z)
            general = self._run(replace(state, rest=rest), split)
            if general.is_exact:
                return general
        return self._run(state, split)

    def _run(self, state: TrimState, split: Iterable[Place]) -> SplitRuns:
        rest = at_any_time(state.rest) if len(state.times) > 1 else state.rest
        return self._runner.run(ChipState(state.ram, rest), {place: state.tables[place] for place in split})

    def _joined(self, state: TrimState, runs: SplitRuns) -> TrimState:
        """Return the one state at the end of runs, whose edges are as they should be."""
        first, last = int(runs.cycles.min()), int(runs.cycles.max())
        position = self._pulses.first_frame(state.position, runs.edges)
        if position.frame >= 0 and runs.edges and len(state.times) > 1:
            raise state.undecided("a pin changes at a time that depends on the EEPROM")
        latest = last - first + state.times[-1]
        position = self._pulses.after_edges(position, runs.edges, runs.addresses, first, latest)
        rest = self._time.with_time_after(state, first, runs.table.rest)
        if EEDATA in state.tables:
            rest = unknown(rest, EEDATA=0xFF)
        later = (np.unique(runs.cycles) - first).tolist()
        times = tuple(sorted({time + more for time in state.times for more in later}))
        return replace(state.joined(runs), rest=rest, times=times, position=position)

    def _with_copies(self, state: TrimState, arrived: TrimState, runs: SplitRuns) -> TrimState:
        """Return a state with tables for what was copied, or computed, from one table without deciding
        anything: each byte of the EEPROM is split alone.
        """
        used: set[Place] = {place for place in runs.table.read if place in state.tables}
        if not used and EEDATA in state.tables:
            used = {EEDATA}
        tables = {place: state.tables[place] for place in used if state.tables[place].pairing is None}
        for address in addresses_of(tables.values()):
            if not any(arrived.is_vague(place) for place in runs.written):
                break
            of_one = [place for place, table in tables.items() if table.addresses == (address,)]
            alone = self._run(state, of_one)
            if alone.joinable:
                arrived = arrived.completed(alone)
        return arrived


def _finer(state: TrimState, split: frozenset[Place], read: Iterable[int]) -> frozenset[Place]:
    """Return more places to split: those that were read and have tables, or EEDATA. Raises UndecidedTrims."""
    more = split | {place for place in read if place in state.tables}
    if more == split and EEDATA in state.tables:
        more |= {EEDATA}
    # Tables of two bytes are split together with others of the same pairing, or not at all: a place that is
    # left out stays unknown.
    pairing = pairing_of(state.tables[place] for place in more)
    more = frozenset(place for place in more if state.tables[place].pairing is pairing)
    if more == split:
        raise state.undecided("an unknown bit decides")  # and it is not a byte of the EEPROM
    addresses = addresses_of(state.tables[place] for place in more)
    if len(addresses) > MAX_TOGETHER:
        raise state.undecided(f"{len(addresses)} bytes of the EEPROM decide together")
    return more
