"""The proof of a contract: its observers run beside the abstract chip, in every state that it can reach.

In: an image, the clauses of a contract, what is quantified over. Out: a `ContractProof`: every way from every
power-up keeps every clause, or a run of one chip that breaks one, or why it is not decided.

Causes at inputs. A program learns of an input's change when it reads the pin. Between a read of one level and
the next read of the other the change may have come in any cycle: the answer is late if it is late for the
earliest of them, and early if it is early for the latest. If a change could come and the next read is later
than the answer is due, the clause is broken as well. What is assumed: an input keeps a level until the
program has read it (a shorter pulse cannot be seen by any program without an interrupt).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from servogen.contract.clauses import Clause
from servogen.contract.events import CHANGES, RISES
from servogen.contract.judge import ClauseVerdict, judge_contract
from servogen.contract.observers import NONE, Broken, Observer, ResponseObserver, State, pin_names
from servogen.edges import HIGH, PINS, UNDRIVEN, EdgeTrace, join, part
from servogen.pic.device import device
from servogen.pic.image import Image
from servogen.prove.chip import AbstractChip
from servogen.prove.counterexample import Counterexample, Sample, levels_of, path_to, stimuli_of
from servogen.prove.cuts import ALL_PLACES
from servogen.prove.explore import (
    Explorer,
    SearchAnswer,
    SearchResult,
    search_until_decided,
    starts_of,
    why_undecided,
)
from servogen.prove.forks import PreparedProgram
from servogen.prove.generalise import Generaliser, Guess
from servogen.prove.quantifiers import EVERYTHING, Quantifiers, trials
from servogen.prove.specification import IN_FRAME, OVER, Edge, Violation
from servogen.prove.transitions import Transitions
from servogen.simulator import Machine, SimulatorOptions, profile
from servogen.simulator.layout import GLITCH
from servogen.simulator.pin_levels import pin_trace
from servogen.units import Clock, Cycles

MAX_STATES = 100_000
MAX_ADDED_CUTS = 24
MAX_REFINEMENTS = 200
SAMPLE_S = (1, 8, 64)
"""Seconds of a plain run from which the first cut is chosen: the shortest in which the main loop repeats."""
LONGEST_RUN_S = 20
"""The longest time without a cut."""
REPEATS = 3
LONG = 1 << 62
"""Cycles that are longer than any limit."""
PERIOD = 20_000
"""Cycles between the resets that are tried for a counterexample, and after its breach."""


UNREAD = 1_000_000
"""Cycles without a read of an input after which a whole pulse of it has been missed."""
STEPS = 128
"""Times since a cause are told apart in so many steps up to its limit."""


class ContractState(NamedTuple):
    """Where in a contract a run is, at an instruction boundary."""

    phase: int
    levels: int
    observers: tuple[State, ...]

    @property
    def is_sampled(self) -> bool:
        return False


@dataclass(frozen=True, slots=True)
class SampledResponse:
    """A response to a cause at an input, which the program reads now and then.

    State: the level that was read last or `NONE`, cycles since, and the most and the fewest cycles since the
    cause, or `NONE`.
    """

    response: ResponseObserver

    @property
    def pin(self) -> int:
        return self.response.when[0].pin

    @property
    def pins(self) -> int:
        return 1 << self.response.then.pin

    def start(self, from_reset: bool) -> State:
        return (NONE, 0, NONE, NONE)

    def _may_come(self, level: int) -> bool:
        """Return whether the cause may come after this level was read."""
        kind = self.response.when[0].kind
        return level != NONE and (kind == CHANGES or level != (kind == RISES))

    def wait(self, state: State, levels: int, cycles: int) -> State:
        level, since, most, fewest = state
        _, most, fewest = self.response.wait((0, most, fewest), levels, cycles)
        limit, cause = self.response.within.most, self.response.when[0]
        if most == NONE and self._may_come(level) and since + cycles > limit + 1:
            raise Broken(f"'{cause}' may come, and is not read within {limit} cycles", limit + 2 - since)
        if most == NONE and since + cycles > UNREAD:
            raise Broken(f"{PINS[cause.pin]} is not read for {UNREAD} cycles", UNREAD + 1 - since)
        return (level, min(since + cycles, max(limit, UNREAD) + 2), most, fewest)

    def read(self, state: State, level: int) -> State:
        """Return the state after the program has read the pin."""
        last, since, most, fewest = state
        if most != NONE and level != last and most < self.response.held:
            most = fewest = NONE
        if most == NONE and self._may_come(last) and level != last:
            most, fewest = max(since - 1, 0), 0  # the earliest is the cycle after the read before
        return (level, 0, most, fewest)

    def react(self, state: State, before: int, after: int) -> State:
        level, since, most, fewest = state
        if most != NONE:
            _, most, fewest = self.response.react((0, most, fewest), before, after)
        return (level, since, most, fewest)

    def coarser(self, state: State) -> State:
        """Return a state that covers this one, of which there are fewer."""
        level, since, most, fewest = state
        step = max(1, self.response.within.most // STEPS)
        least = self.response.within.least
        # A fewest time that is long enough is as good as any longer one.
        fewest = fewest if fewest == NONE else least if fewest >= least else fewest // step * step
        if most == NONE and not self._may_come(level):
            since = _up(since, UNREAD // STEPS)
        return (level, _up(since, step), most if most == NONE else _up(most, step), fewest)

    def sees(self, state: State, before: int, after: int) -> bool:
        return False

    def after_breach(self) -> State:
        return self.start(from_reset=False)


def _up(cycles: int, step: int) -> int:
    return -(-cycles // step) * step


class ContractSpecification:
    """A contract as the search follows it: see `specification.Specification`."""

    def __init__(self, clauses: Sequence[Clause], inputs: int) -> None:
        """Prepare the observers; `inputs` are the pins that the program does not drive, as bits."""
        self.period = PERIOD
        self._inputs = inputs
        self._observers = [_beside_inputs(clause.observer, inputs) for clause in clauses]
        self._names = [clause.text for clause in clauses]
        self._sampled = {each.pin for each in self._observers if isinstance(each, SampledResponse)}

    @property
    def sampled(self) -> frozenset[int]:
        """Return the input pins whose levels count."""
        return frozenset(self._sampled)

    def start(self) -> ContractState:
        observers = tuple(observer.start(from_reset=True) for observer in self._observers)
        return ContractState(IN_FRAME, 0, observers)

    def at_rest(self, state: ContractState) -> ContractState:
        """Return that nothing is due, if any time may pass; else the state as it is."""
        for observer, each in zip(self._observers, state.observers, strict=True):
            try:
                if observer.wait(each, state.levels, LONG) != observer.wait(each, state.levels, 0):
                    return state
            except Broken:
                return state
        return state._replace(phase=OVER)

    def generalised(self, state: ContractState) -> ContractState:
        """Return a state at a cut that covers this one: times since a cause become coarser, outwards."""
        pairs = zip(self._observers, state.observers, strict=True)
        observers = tuple(
            each.coarser(its) if isinstance(each, SampledResponse) else its for each, its in pairs
        )
        return state._replace(observers=observers)

    def sample(self, state: ContractState, pin: int, level: int) -> ContractState:
        """Return the state after the program has read a pin."""
        if pin not in self._sampled:
            return state
        pairs = zip(self._observers, state.observers, strict=True)
        observers = tuple(
            each.read(its, level) if isinstance(each, SampledResponse) and each.pin == pin else its
            for each, its in pairs
        )
        return state._replace(observers=observers)

    def advance(self, state: ContractState, edges: Sequence[Edge], cycles: int) -> ContractState:
        """Return the state after a run of `cycles` that made `edges`. Raises Violation."""
        observers, levels, now = state.observers, state.levels, 0
        for cycle, group in groupby(edges, key=itemgetter(0)):
            observers = self._waited(observers, levels, now, cycle - now)
            after = levels
            for _, pin, level in group:
                after = after | 1 << pin if level == 1 else after & ~(1 << pin)
            if after & self._inputs:
                names = pin_names(after & self._inputs)
                raise Violation(f"{names} is driven, and was not in a plain run", cycle, certain=False)
            observers = self._reacted(observers, levels, after, cycle)
            levels, now = after, cycle
        return ContractState(IN_FRAME, levels, self._waited(observers, levels, now, cycles - now))

    def _waited(self, states: tuple[State, ...], levels: int, begin: int, cycles: int) -> tuple[State, ...]:
        made = []
        for number, (observer, state) in enumerate(zip(self._observers, states, strict=True)):
            try:
                made.append(observer.wait(state, levels, cycles))
            except Broken as broken:
                raise Violation(f"{self._names[number]}: {broken.message}", begin + broken.after) from None
        return tuple(made)

    def _reacted(self, states: tuple[State, ...], before: int, after: int, cycle: int) -> tuple[State, ...]:
        made = []
        for number, (observer, state) in enumerate(zip(self._observers, states, strict=True)):
            try:
                made.append(observer.react(state, before, after))
            except Broken as broken:
                raise Violation(f"{self._names[number]}: {broken.message}", cycle) from None
        return tuple(made)


def _beside_inputs(observer: Observer, inputs: int) -> Observer:
    causes = isinstance(observer, ResponseObserver) and observer.when[0].pin
    if isinstance(observer, ResponseObserver) and inputs >> int(causes) & 1:
        return SampledResponse(observer)
    return observer


def undecidable(clauses: Sequence[Clause], inputs: int) -> str | None:
    """Return why a contract cannot be proven, where a clause is about inputs in a way that no read tells."""
    for clause in clauses:
        observer = clause.observer
        allowed = 0
        if isinstance(observer, ResponseObserver) and len(observer.when) == 1:
            allowed = 1 << observer.when[0].pin & ~(1 << observer.then.pin)
        asked = observer.pins & inputs & ~allowed
        if asked:
            what = "a pattern of several events" if isinstance(observer, ResponseObserver) else "a clause"
            names = pin_names(asked)
            return f"line {clause.place.line}: {what} about {names}, which the program does not drive"
    return None


@dataclass(frozen=True, slots=True)
class ContractProof:
    """An answer, with what it rests on."""

    proven: bool
    counterexample: Counterexample | None
    reason: str
    """Why it is not decided."""
    states: int
    runs: int
    cycles: Cycles
    assumptions: tuple[str, ...]


def prove_contract(
    image: Image,
    clauses: Sequence[Clause],
    clock: Clock,
    quantifiers: Quantifiers = EVERYTHING,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    tell: Callable[[int, int], None] = lambda explored, known: None,
    max_states: int = MAX_STATES,
) -> ContractProof:
    """Return whether `image` keeps every clause for everything that is quantified over."""
    return _ContractProver(image, clauses, clock, quantifiers, options, tell, max_states).prove()


class _ContractProver:
    def __init__(
        self,
        image: Image,
        clauses: Sequence[Clause],
        clock: Clock,
        quantifiers: Quantifiers,
        options: SimulatorOptions,
        tell: Callable[[int, int], None],
        max_states: int,
    ) -> None:
        self._image, self._clauses, self._clock = image, clauses, clock
        self._quantifiers, self._tell, self._max_states = quantifiers, tell, max_states
        self._board = replace(options, start=quantifiers.start)
        longest = device(options.device).max_eeprom_write_us if quantifiers.eeprom_write else None
        watched = 0
        for clause in clauses:
            watched |= clause.observer.pins
        self._chip = AbstractChip(
            image, clock, self._board, {}, quantifiers.watchdog, longest, of_no_interest=~watched
        )
        self._write_us = longest or self._board.eeprom_us
        self._program = PreparedProgram(image, quantifiers.eeprom_write, tells_timers=True)
        limit = clock.round_seconds(LONGEST_RUN_S)
        self._transitions = Transitions(self._chip, limit)
        self._always = self._program.choice_points
        self._cut, driven = _observed(image, clock, self._board)
        self._inputs = watched & ~driven
        self._spec = ContractSpecification(clauses, self._inputs)

    def prove(self) -> ContractProof:
        """Return the answer: search, add what the search asks for, and search again until it is decided."""
        why = undecidable(self._clauses, self._inputs) or self._unfit_oscillator()
        if why:
            return self._answer(None, why)
        guesses = {} if self._cut is None else {self._cut: Guess(set(ALL_PLACES))}
        generaliser = Generaliser(self._transitions, guesses)

        def search(written: frozenset[int]) -> SearchResult:
            self._transitions.stop_at(self._always | set(generaliser.cuts))
            return Explorer(
                self._program,
                self._transitions,
                self._spec,  # type: ignore[arg-type]
                generaliser,
                self._quantifiers.phases,
                self._max_states,
                self._tell,
                starts_of(self._chip, self._quantifiers, written),
            ).search()

        def add_cut(address: int) -> None:
            generaliser.guesses[address] = Guess(set(ALL_PLACES))

        most = MAX_ADDED_CUTS, MAX_REFINEMENTS
        return self._judged(search_until_decided(search, add_cut, most, self._written)[0])

    def _written(self) -> frozenset[int]:
        return frozenset(self._transitions.written if self._quantifiers.start else ())

    def _unfit_oscillator(self) -> str:
        """Return why the clock is not that of the configuration word; empty if it may be."""
        machine = Machine(self._image, self._clock, self._board, tracked=True)
        return "; ".join(warning.message for warning in machine.chip_dependent)

    def _judged(self, search: SearchResult) -> ContractProof:
        if search.answer is SearchAnswer.CLOSED:
            return self._answer(search, self._not_covered(search))
        finding = search.finding
        if finding is None:
            return self._answer(search, "the cut points do not suffice")
        if search.answer is SearchAnswer.VIOLATED and finding.certain:
            shown = self._counterexample(search)
            if shown is not None:
                return self._answer(search, "", shown)
        return self._answer(search, why_undecided(finding, search))

    def _not_covered(self, search: SearchResult) -> str:
        if search.asynchronous and self._spec.sampled:
            names = ", ".join(PINS[pin] for pin in sorted(self._spec.sampled))
            return f"something other than TMR0 interrupts the program, which may see {names} without a read"
        return ""

    def _answer(
        self, search: SearchResult | None, reason: str, shown: Counterexample | None = None
    ) -> ContractProof:
        return ContractProof(
            proven=search is not None and not reason and shown is None,
            counterexample=shown,
            reason=reason,
            states=len(search.nodes) if search else 0,
            runs=self._transitions.runs,
            cycles=Cycles(self._transitions.cycles),
            assumptions=self._assumptions(),
        )

    def _assumptions(self) -> tuple[str, ...]:
        said = [
            "the instruction set's table, servogen/pic/isa.py",
            "timers, ports and resets as docs/simulator.md lists them, with the data sheet's sections",
            "the crystal is exact; a pin that nothing drives counts as low; the EEPROM is as in the file",
            f"a high level of at most {GLITCH} cycles while a pin becomes an output counts as low",
        ]
        said += [f"{PINS[pin]} keeps each level until it was read" for pin in sorted(self._spec.sampled)]
        if not self._quantifiers.resets:
            said.append("there is no reset after power-on")
        write_us = self._write_us if self._program.eeprom_accesses else None
        said += self._quantifiers.assumed_of_chip(self._board, bool(self._chip.watchdog), write_us)
        if not self._quantifiers.tmr0_phase:
            said.append("TMR0 counts from the cycle after OPTION_REG is written")
        return tuple(said)

    def _counterexample(self, search: SearchResult) -> Counterexample | None:
        """Return a run of one chip along the way to the finding, or like it, that breaks a clause."""
        assert search.finding is not None
        path = path_to(search.nodes, search.finding)
        end = Cycles(path.end + 2 * PERIOD)
        board = replace(self._board, tmr0_phase=path.tmr0_phase)
        for trial in trials(board, self._quantifiers, path.start, PERIOD):
            begun = 0 if trial.reset is None else trial.reset + 1
            for samples in (path.samples, _early(path.samples)):
                levels = levels_of([(begun + cycle, pin, level) for cycle, pin, level in samples], {})
                stimuli, cycles = stimuli_of(trial, levels), Cycles(begun + end)
                trace = pin_trace(self._image, self._clock, cycles, trial.options, stimuli)
                later = _without_glitch(_since(trace, begun), self._inputs)
                verdict = judge_contract(self._clauses, later, from_reset=True)
                broken = [each for each in verdict.clauses if each.first is not None]
                if broken:
                    first = min(broken, key=_first_cycle)
                    message = f"{first.clause.text}: {first.first.message}" if first.first else ""
                    cycle = Cycles(begun + _first_cycle(first))
                    return Counterexample(message, cycle, trial.options, levels, reset=trial.reset)
        return None


def _first_cycle(verdict: ClauseVerdict) -> int:
    return verdict.first.cycle if verdict.first is not None else 0


def _since(trace: EdgeTrace, begun: int) -> EdgeTrace:
    """Return what comes from a reset on, in cycles since it; the chip drives no pin then."""
    chunk = join(trace.chunks)
    later = part(chunk, chunk.cycle >= begun)
    shifted = later._replace(cycle=later.cycle - begun)
    return EdgeTrace(trace.clock, (shifted,), Cycles(trace.end - begun))


def _without_glitch(trace: EdgeTrace, inputs: int) -> EdgeTrace:
    """Return the trace without a short high level that an output begins with, as its latch held it before."""
    chunk = join(trace.chunks)
    kept = np.ones(len(chunk.cycle), dtype=bool)
    for pin in (pin for pin in range(len(PINS)) if not inputs >> pin & 1):
        own = np.flatnonzero((chunk.pin == pin) & (chunk.level != UNDRIVEN))[:2]
        if len(own) == 2 and chunk.level[own[0]] == HIGH and np.diff(chunk.cycle[own])[0] <= GLITCH:
            kept[own] = False
    return EdgeTrace(trace.clock, (part(chunk, kept),), trace.end)


def _early(samples: Sequence[Sample]) -> list[Sample]:
    """Return levels that change as early as the reads allow: in the cycle after the read before.

    After its last read, each pin changes once more.
    """
    made: list[Sample] = []
    last: dict[int, Sample] = {}
    for sample in sorted(samples):
        _, pin, level = sample
        before = last.get(pin)
        made.append((before[0] + 1, pin, level) if before is not None and before[2] != level else sample)
        last[pin] = sample
    return made + [(cycle + 1, pin, 1 - level) for cycle, pin, level in last.values()]


def _observed(image: Image, clock: Clock, board: SimulatorOptions) -> tuple[int | None, int]:
    """Return the first cut, and the pins that a plain run of a second drives, as bits.

    The cut is what the outermost loop executes: the address with the fewest executions that repeats.
    """
    chunk = join(Machine(image, clock, board).stream(clock.round_seconds(1)))
    driven = 0
    for pin in set(chunk.pin[chunk.level != UNDRIVEN].tolist()):
        driven |= 1 << pin
    for seconds in SAMPLE_S:
        found = profile(Machine(image, clock, board), clock.round_seconds(seconds))
        counts = {address: spent.executions for address, spent in found.words.items()}
        again = [address for address, count in counts.items() if count >= REPEATS]
        if again:
            return min(again, key=lambda address: (counts[address], address)), driven
    return None, driven
