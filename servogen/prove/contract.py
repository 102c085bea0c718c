"""The proof of a contract: its observers run beside the abstract chip, in every state that it can reach.

In: an image, the clauses of a contract, what is quantified over. Out: a `ContractProof`: every way from every
power-up keeps every clause, or a run of one chip that breaks one, or why it is not decided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from servogen.contract.clauses import Clause
from servogen.contract.judge import ClauseVerdict, judge_contract
from servogen.contract.observers import Broken, ResponseObserver, State, pin_names
from servogen.edges import HIGH, PINS, UNDRIVEN, EdgeTrace, join, part
from servogen.pic.device import device
from servogen.pic.image import Image
from servogen.prove.chip import AbstractChip
from servogen.prove.counterexample import Counterexample, Sample, levels_of, path_to, stimuli_of
from servogen.prove.cuts import ALL_PLACES, needs_w
from servogen.prove.explore import (
    Explorer,
    SearchAnswer,
    SearchResult,
    search_until_decided,
    starts_of,
    why_undecided,
)
from servogen.prove.forks import PreparedProgram
from servogen.prove.generalise import Generaliser, Guess, general_cells
from servogen.prove.quantifiers import EVERYTHING, ChipTrial, Quantifiers, trials
from servogen.prove.sides import SampledResponse, Side, sides_of
from servogen.prove.specification import IN_FRAME, OVER, Edge, Violation
from servogen.prove.transitions import Transitions
from servogen.simulator import Machine, SimulatorOptions, profile
from servogen.simulator.layout import GLITCH
from servogen.simulator.pin_levels import pin_trace
from servogen.units import Clock, Cycles

MAX_STATES = 100_000
MAX_ADDED_CUTS = 24
MAX_REFINEMENTS = 200
MAX_LATCHES = 8
"""Outputs whose latches at the start are told apart, if need be."""
SAMPLE_S = (1, 8, 64)
"""Seconds of a plain run, after one second, from which the first cut is chosen: as few as the main loop needs
to repeat."""
LONGEST_RUN_S = 20
"""The longest time without a cut."""
REPEATS = 3
PERIOD = 20_000
"""Cycles between the resets that are tried for a counterexample, and after its breach."""


class ContractState(NamedTuple):
    """Where in a contract a run is, at an instruction boundary."""

    phase: int
    levels: int
    observed: State

    @property
    def is_sampled(self) -> bool:
        return False


class ContractSpecification:
    """A half of a clause as the search follows it: see `specification.Specification`."""

    def __init__(self, side: Side, inputs: int) -> None:
        """Prepare it; `inputs` are the pins that the program does not drive, as bits."""
        self.period = PERIOD
        self._side, self._observer, self._inputs = side, side.observer, inputs
        self._pins = side.observer.pins | inputs
        self._response = side.observer if isinstance(side.observer, SampledResponse) else None
        causes = side.observer.when if isinstance(side.observer, ResponseObserver) else ()
        self._causes = frozenset(each.pin for each in causes)
        """The pins of causes that a plain run drives."""

    @property
    def sampled(self) -> frozenset[int]:
        """Return the input pins whose levels count."""
        return frozenset({self._response.pin} if self._response else self._causes)

    def start(self) -> ContractState:
        return ContractState(IN_FRAME, 0, self._observer.start(from_reset=True))

    def ordered(self, state: ContractState) -> tuple[object, State]:
        """Return what of a state must be the same in a worse one, and numbers that are greater in it."""
        same, times = self._side.ordered(state.observed)
        return (state.phase, state.levels, same), times

    def at_rest(self, state: ContractState) -> ContractState:
        """Return the worst state after any time, if any may pass; else the state as it is."""
        try:
            later = self._side.asleep(state.observed, state.levels)
        except Broken:
            return state
        return state if later is None else state._replace(phase=OVER, observed=later)

    def sample(self, state: ContractState, pin: int, level: int) -> ContractState:
        """Return the state after the program has read a pin."""
        # On another chip it may be an input, whose events no edge of the program shows.
        if pin in self._causes:
            raise Violation(f"{PINS[pin]} is read, and was driven in a plain run", 0, certain=False)
        if self._response is None or pin != self._response.pin:
            return state
        return state._replace(observed=self._response.read(state.observed, level))

    def advance(self, state: ContractState, edges: Sequence[Edge], cycles: int) -> ContractState:
        """Return the state after a run of `cycles` that made `edges`. Raises Violation."""
        observed, levels, now = state.observed, state.levels, 0
        try:
            for cycle, group in groupby(edges, key=itemgetter(0)):
                observed = self._observer.wait(observed, levels, cycle - now)
                after, now = levels, cycle
                for _, pin, level in group:
                    after = after | 1 << pin if level == 1 else after & ~(1 << pin)
                if after & self._inputs:
                    names = pin_names(after & self._inputs)
                    raise Violation(f"{names} is driven, and was not in a plain run", cycle, certain=False)
                observed, levels = self._observer.react(observed, levels, after), after & self._pins
            observed = self._observer.wait(observed, levels, cycles - now)
        except Broken as broken:
            raise Violation(f"{self._side.text}: {broken.message}", now + broken.after) from None
        return ContractState(IN_FRAME, levels, observed)


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
    cuts: dict[int, frozenset[str]]
    """What was made general at each cut, as the checker calls it."""
    inputs: int
    """The pins of the contract that the program does not drive, as bits."""


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
        cut, driven = _observed(self._program, clock, self._board)
        guesses = {} if cut is None else {cut: Guess(set(ALL_PLACES))}
        self._generaliser = Generaliser(self._transitions, guesses)
        self._inputs = watched & ~driven
        self._driven = watched & driven
        self._outputs = self._driven if self._driven.bit_count() <= MAX_LATCHES else 0
        self._latches = 0
        self._specs = [
            ContractSpecification(side, self._inputs)
            for clause in clauses
            for side in sides_of(clause, self._inputs)
        ]

    def prove(self) -> ContractProof:
        """Return the answer: proven if each half of each clause is; else that of the first that is not."""
        why = undecidable(self._clauses, self._inputs) or self._unfit_oscillator()
        if why:
            return self._answer(None, why)
        answers = []
        for spec in self._specs:
            self._latches = 0
            answers.append(self._decided(spec))
            if answers[-1].counterexample is not None:
                return answers[-1]
        undecided = next((answer for answer in answers if not answer.proven), answers[-1])
        return replace(undecided, states=sum(answer.states for answer in answers))

    def _decided(self, spec: ContractSpecification) -> ContractProof:
        """Return the first answer that is one: what was made general may be what leads to a violation that no
        chip shows, and so may a latch that is not known.
        """
        answer = self._searched(spec)
        for less_general in (self._generaliser.keep_all, self._tell_latches):
            if answer.proven or answer.counterexample is not None:
                break
            less_general()
            answer = self._searched(spec)
        return answer

    def _tell_latches(self) -> None:
        self._latches = self._outputs

    def _searched(self, spec: ContractSpecification) -> ContractProof:
        """Search, add what the search asks for, and search again until it is decided."""
        generaliser = self._generaliser

        def search(written: frozenset[int]) -> SearchResult:
            self._transitions.stop_at(self._always | set(generaliser.cuts))
            return Explorer(
                self._program,
                self._transitions,
                spec,  # type: ignore[arg-type]
                generaliser,
                self._quantifiers.phases,
                self._max_states,
                self._tell,
                starts_of(self._chip, self._quantifiers, written),
                self._latches,
            ).search()

        def add_cut(address: int) -> None:
            generaliser.guesses[address] = Guess(set(ALL_PLACES))

        most = MAX_ADDED_CUTS, MAX_REFINEMENTS
        return self._judged(spec, search_until_decided(search, add_cut, most, self._written)[0])

    def _written(self) -> frozenset[int]:
        return frozenset(self._transitions.written if self._quantifiers.start else ())

    def _unfit_oscillator(self) -> str:
        """Return why the clock is not that of the configuration word; empty if it may be."""
        machine = Machine(self._image, self._clock, self._board, tracked=True)
        return "; ".join(warning.message for warning in machine.chip_dependent)

    def _judged(self, spec: ContractSpecification, search: SearchResult) -> ContractProof:
        if search.answer is SearchAnswer.CLOSED:
            return self._answer(search, self._not_covered(spec, search))
        finding = search.finding
        if finding is None:
            return self._answer(search, "the cut points do not suffice")
        if search.answer is SearchAnswer.VIOLATED and finding.certain:
            shown = self._counterexample(search)
            if shown is not None:
                return self._answer(search, "", shown)
        return self._answer(search, why_undecided(finding, search))

    def _not_covered(self, spec: ContractSpecification, search: SearchResult) -> str:
        if search.asynchronous and spec.sampled:
            names = ", ".join(PINS[pin] for pin in spec.sampled)
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
            cuts={pc: general_cells(guess) for pc, guess in self._generaliser.cuts.items()},
            inputs=self._inputs,
        )

    def _assumptions(self) -> tuple[str, ...]:
        said = [
            "the instruction set's table, servogen/pic/isa.py",
            "timers, ports and resets as docs/simulator.md lists them, with the data sheet's sections",
            "the crystal is exact; a pin that nothing drives counts as low; the EEPROM is as in the file",
            f"a high level of at most {GLITCH} cycles while a pin becomes an output counts as low",
        ]
        sampled = {pin for spec in self._specs for pin in spec.sampled if self._inputs >> pin & 1}
        until = "until it was read, other than to write its port; the level of the first read is no cause"
        said += [f"{PINS[pin]} keeps each level {until}" for pin in sorted(sampled)]
        if self._driven:
            said.append(f"nothing but the program drives {pin_names(self._driven)}")
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
                broken = self._broken(_since(trace, begun), trial)
                if broken:
                    first = min(broken, key=_first_cycle)
                    message = f"{first.clause.text}: {first.first.message}" if first.first else ""
                    cycle = Cycles(begun + _first_cycle(first))
                    return Counterexample(message, cycle, trial.options, levels, reset=trial.reset)
        return None

    def _broken(self, trace: EdgeTrace, trial: ChipTrial) -> list[ClauseVerdict]:
        """Return the clauses that a run from a reset breaks, also with what is assumed of an old latch."""
        broken = [
            each for each in judge_contract(self._clauses, trace, from_reset=True).clauses if each.first
        ]
        begins_low = trial.reset is None and trial.options.start_seed is None
        latches_known = self._latches or (begins_low and "latches" not in dict(trial.options.start))
        if latches_known or not broken:
            return broken
        clauses = [each.clause for each in broken]
        assumed = judge_contract(clauses, _without_glitch(trace, self._inputs), from_reset=True).clauses
        return [each for each, again in zip(broken, assumed, strict=True) if again.first]


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


def _observed(program: PreparedProgram, clock: Clock, board: SimulatorOptions) -> tuple[int | None, int]:
    """Return the first cut, and the pins that a plain run of a second drives, as bits.

    The cut is what the outermost loop executes: of the addresses with the fewest executions that repeat one
    that does not need W.
    """
    machine = Machine(program.image, clock, board)
    chunk = join(machine.stream(clock.round_seconds(1)))
    driven = 0
    for pin in set(chunk.pin[chunk.level != UNDRIVEN].tolist()):
        driven |= 1 << pin
    for seconds in SAMPLE_S:
        found = profile(machine, clock.round_seconds(seconds))
        counts = {address: spent.executions for address, spent in found.words.items()}
        rare = min((count for count in counts.values() if count >= REPEATS), default=0)
        if rare:  # the sample may begin and end within the loop
            outermost = [address for address, count in counts.items() if 0 <= count - rare <= 1]
            return min(outermost, key=lambda address: (needs_w(program, address), address)), driven
    return None, driven
