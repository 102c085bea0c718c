"""The proof: choose cut points, search, refine, and search again, until the answer is one of three.

In: an image, a schedule, what is to be quantified over. Out: `Proof`: proven with its states and
assumptions, a counterexample that a plain run has shown, or why it is not decided.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace

from servogen.edges import PINS
from servogen.engines.board import board_of
from servogen.graph import components
from servogen.pic.device import CONFIG_OSCILLATOR_MASK, OSCILLATORS, PROGRAM_WORDS, device
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.prove.chip import AbstractChip
from servogen.prove.counterexample import Case, Counterexample, concrete, regular_wire, slow_oscillator
from servogen.prove.cuts import choose_cuts, rising_addresses
from servogen.prove.eeprom import TrimSearch
from servogen.prove.explore import (
    Explorer,
    SearchAnswer,
    SearchFinding,
    SearchResult,
    search_until_decided,
    starts_of,
    why_undecided,
)
from servogen.prove.forks import PreparedProgram
from servogen.prove.generalise import Generaliser, Guess
from servogen.prove.nodes import Node
from servogen.prove.quantifiers import EVERYTHING, Quantifiers
from servogen.prove.specification import OVER, Specification
from servogen.prove.tables import UndecidedTrims
from servogen.prove.transitions import Transitions
from servogen.prove.trim_pulses import WrongEdge
from servogen.prove.trims import TrimProof, TrimResult
from servogen.prove.wire import FollowedWire
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import START_FRAMES
from servogen.simulator import Machine, SimulatorOptions
from servogen.units import Cycles

MAX_STATES = 400_000
MAX_ADDED_CUTS = 12
MAX_REFINEMENTS = 60
AS_IN_THE_FILE = "the EEPROM holds what the file says"
INPUTS_CHANGE = "levels of inputs change between instruction cycles"
EXACT_CRYSTAL = f"{INPUTS_CHANGE}; the crystal is exact"

Tell = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Proof:
    """An answer, with what it rests on."""

    proven: bool
    counterexample: Counterexample | None
    reason: str
    """Why it is not decided."""
    assumptions: tuple[str, ...]
    quantifiers: Quantifiers
    states: int
    runs: int
    cycles: Cycles
    """Simulated, all runs together."""
    nodes: tuple[Node, ...] = ()
    cuts: Mapping[int, Guess] = field(default_factory=dict)
    """The cut points by address, in ascending order, with what is general at each."""
    transitions: Transitions | None = field(default=None, repr=False)
    held: dict[int, int] = field(default_factory=dict)
    asynchronous: bool = False
    """Whether something other than TMR0 may interrupt the program, end its SLEEP or its EEPROM write."""
    silence: int | None = None
    """The cycles from a reset to the first pulse, at least; None where no way comes to one by itself."""


def prove_for_all(
    image: Image,
    schedule: PulseSchedule,
    quantifiers: Quantifiers = EVERYTHING,
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008 - frozen
    tell: Tell = lambda explored, known: None,
    max_states: int = MAX_STATES,
    cuts: Mapping[int, Guess] | None = None,
) -> Proof:
    """Return the proof that `image` follows `schedule` for everything quantified over, or why there is
    none.

    `cuts` are those of the proof of a program much like this one, to begin with; by default a run of this
    one is asked for them.
    """
    return _Prover(image, schedule, quantifiers, options, tell, max_states).prove(cuts)


class _Prover:
    def __init__(
        self,
        image: Image,
        schedule: PulseSchedule,
        quantifiers: Quantifiers,
        options: SimulatorOptions,
        tell: Tell,
        max_states: int,
    ) -> None:
        self._image = image
        self._schedule = schedule
        self._quantifiers = quantifiers
        self._board = replace(board_of(schedule, options), start=quantifiers.start)
        self._tell = tell
        self._max_states = max_states
        inputs = {PINS.index(source.pin): source.level for source in schedule.inputs}
        known = schedule.buttons is not None or schedule.commands is not None
        free = quantifiers.inputs and not quantifiers.any_eeprom
        # A pin is free only if the schedule says what each of its levels means; another one keeps the level
        # that the schedule states, which then is an assumption of the proof.
        self._held = {} if known and free else inputs
        rules = (schedule.buttons, schedule.commands) if free else (None, None)
        wire = schedule.wire if free else None
        self._spec = FollowedWire(schedule, wire) if wire else Specification(schedule, *rules)
        self._longest = device(self._board.device).max_eeprom_write_us if quantifiers.eeprom_write else None
        self._write_us = self._longest or self._board.eeprom_us
        self._chip = self._abstract_chip(image)
        self._program = PreparedProgram(image, quantifiers.eeprom_write)
        # No run between two stops may be longer than the time in which an edge has to come.
        limit = START_FRAMES * self._spec.period + 2 * self._spec.longest_silence
        self._transitions = Transitions(self._chip, limit)
        self._cuts: dict[int, Guess] = {}
        self._always = self._program.choice_points  # a run stops at each of them

    def prove(self, cuts: Mapping[int, Guess] | None) -> Proof:
        """Return the answer: search, add what the search asks for, and search again until it is decided."""
        if self._schedule.wire is not None:
            if not isinstance(self._spec, FollowedWire):
                return self._result(None, None, "the wire from another chip cannot be held at one level")
            if self._schedule.inputs or self._schedule.buttons or self._schedule.commands:
                return self._result(None, None, "a wire is not covered in a program that reads other inputs")
        if self._schedule.tape is not None and self._quantifiers.any_eeprom:
            return self._result(None, None, "any EEPROM: the trims of a tape are not covered")
        unfit = self._unfit_oscillator()
        if unfit is not None:
            return unfit
        guesses = deepcopy(dict(cuts)) if cuts is not None else self._chosen_cuts()
        generaliser = Generaliser(self._transitions, guesses)

        def search(written: frozenset[int]) -> SearchResult:
            self._transitions.stop_at(self._always | set(generaliser.cuts))
            return Explorer(
                self._program,
                self._transitions,
                self._spec,
                generaliser,
                self._quantifiers.phases,
                self._max_states,
                self._tell,
                starts_of(self._chip, self._quantifiers, written),
            ).search()

        most = MAX_ADDED_CUTS, MAX_REFINEMENTS
        found, written = search_until_decided(search, generaliser.add_cut, most, self._written)
        self._cuts = {pc: generaliser.guesses[pc] for pc in sorted(generaliser.guesses)}
        answer = self._answer(found)
        if answer.proven and self._quantifiers.any_eeprom:
            return self._any_eeprom(answer, generaliser, written)
        return answer

    def _chosen_cuts(self) -> dict[int, Guess]:
        return choose_cuts(self._program, self._transitions, self._schedule, self._spec, self._always)

    def _written(self) -> frozenset[int]:
        """Return the places that the program has written, if there are start values that this ends."""
        return frozenset(self._transitions.written if self._quantifiers.start else ())

    def _abstract_chip(self, image: Image, any_eeprom: bool = False) -> AbstractChip:
        """Return the chip on the schedule's board, with another program or content of the EEPROM."""
        watchdog, clock = self._quantifiers.watchdog, self._schedule.clock
        return AbstractChip(
            image,
            clock,
            self._board,
            self._held,
            watchdog,
            self._longest,
            any_eeprom,
            tape=self._schedule.tape,
            restart=self._spec.restart,
        )

    def _any_eeprom(self, plain: Proof, generaliser: Generaliser, written: frozenset[int]) -> Proof:
        """Return the answer for any content of the EEPROM, where that of the file has been proven, with which
        the program writes the places in `written`.
        """
        if self._spec.start().phase == OVER:
            return replace(plain, proven=False, reason="any EEPROM: the schedule has no pulses")
        runs = TrimSearch(self._image, self._schedule, self._board, self._held)
        erased = runs.erased()
        if erased is not None:
            return replace(plain, proven=False, counterexample=erased)
        if plain.asynchronous:
            return replace(plain, proven=False, reason="any EEPROM: something other than TMR0 interrupts")
        suspect: dict[int, int] = {}
        try:
            trimmed = self._trimmed(generaliser, written)
        except UndecidedTrims as undecided:
            reason = f"any EEPROM: {undecided}"
        except WrongEdge as wrong:
            suspect, reason = wrong.content, f"any EEPROM: {wrong.message} (frame {wrong.frame})"
        else:
            assumptions = tuple(
                assumption for assumption in self._assumptions() if assumption != AS_IN_THE_FILE
            )
            trims = trims_text(self._schedule, trimmed.bytes)
            return replace(plain, assumptions=(*assumptions, trims), runs=plain.runs + trimmed.runs)
        shown = runs.search(suspect)
        return replace(plain, proven=False, counterexample=shown, reason="" if shown else reason)

    def _trimmed(self, generaliser: Generaliser, written: frozenset[int]) -> TrimResult:
        """Return what is proven for any content of the EEPROM. Raises UndecidedTrims, WrongEdge."""
        # NOPs only: what the timers do while so many cycles pass.
        idle = self._abstract_chip(
            replace(self._image, program=dict.fromkeys(range(PROGRAM_WORDS), encode("NOP")))
        )
        chip = self._abstract_chip(self._image, any_eeprom=True)
        rises = rising_addresses(self._image, self._schedule)
        while True:
            trimmed = TrimProof(
                self._program,
                self._schedule,
                generaliser,
                chip,
                idle,
                always=self._always,
                rises=rises,
                phases=self._quantifiers.phases,
                limit=self._transitions.limit,
            ).prove(starts_of(self._chip, self._quantifiers, written))
            self._chip.released |= chip.released
            # With other contents the program may write more places, which then are unknown after a reset.
            if not self._quantifiers.start or trimmed.written <= written:
                return trimmed
            written |= trimmed.written

    @property
    def _case(self) -> Case:
        """Return what a counterexample is about."""
        return Case(
            image=self._image,
            schedule=self._schedule,
            spec=self._spec,
            board=self._board,
            quantifiers=self._quantifiers,
            held=self._held,
        )

    def _unfit_oscillator(self) -> Proof | None:
        """Return the answer where the configuration word says that the clock is not the schedule's."""
        machine = Machine(self._image, self._schedule.clock, self._board, tracked=True)
        warnings = machine.chip_dependent
        if not warnings:
            return None
        config = self._image.config
        if config is None or config & CONFIG_OSCILLATOR_MASK == OSCILLATORS["RC"]:
            shown = slow_oscillator(self._case)
            if shown is not None:
                return self._result(None, shown, "")
        return self._result(None, None, "; ".join(warning.message for warning in warnings))

    def _answer(self, search: SearchResult) -> Proof:
        if search.answer is SearchAnswer.CLOSED:
            idle = endless_wait(search)
            if idle is None:
                return self._result(search, None, "")
            pc = self._transitions.pc(search.nodes[idle].rest)
            finding = SearchFinding(
                node=idle, decisions=(), cycle=0, message="no pulse comes", certain=True, pc=pc, silent=True
            )
            search = SearchResult(SearchAnswer.VIOLATED, search.nodes, finding)
        finding = search.finding or SearchFinding(
            node=0, decisions=(), cycle=0, message="the cut points do not suffice", certain=False, pc=0
        )
        shown = regular_wire(self._case)
        if shown is None and search.answer is SearchAnswer.VIOLATED and finding.certain:
            shown = concrete(self._case, search.nodes, finding)
        return self._result(search, shown, "" if shown else why_undecided(finding, search))

    def _result(self, search: SearchResult | None, shown: Counterexample | None, reason: str) -> Proof:
        nodes = search.nodes if search else []
        return Proof(
            proven=shown is None and not reason,
            counterexample=shown,
            reason=reason,
            assumptions=self._assumptions(),
            quantifiers=self._quantifiers,
            states=sum(node.parent >= 0 for node in nodes),
            runs=self._transitions.runs,
            cycles=Cycles(self._transitions.cycles),
            nodes=tuple(nodes),
            cuts=self._cuts,
            transitions=self._transitions,
            held=self._held,
            asynchronous=search is not None and search.asynchronous,
            silence=search.silence if search else None,
        )

    def _assumptions(self) -> tuple[str, ...]:
        assumptions = [
            "the instruction set's table, servogen/pic/isa.py",
            "timers, ports and resets as docs/simulator.md lists them, with the data sheet's sections",
            "no servo responds to a pulse of at most 10 cycles before the first frame",
            "a reset cuts the current pulse short; after it the same holds from the first pulse on"
            if self._quantifiers.resets
            else "there is no reset after power-on",
            EXACT_CRYSTAL,
            AS_IN_THE_FILE,
        ]
        write_us = self._write_us if self._program.eeprom_accesses else None
        assumptions += self._quantifiers.assumed_of_chip(self._board, bool(self._chip.watchdog), write_us)
        assumptions += held_assumptions(self._held, self._schedule)
        tape = self._schedule.tape
        if tape is not None:
            assumptions.append(
                f"the EEPROM of the tape holds {tape.digest}, is a {tape.eeprom} by its data sheet with A0 "
                "to A2 low, stays under power, and nothing writes to it (WP high); SCL and SDA have resistors"
            )
        if not self._quantifiers.tmr0_phase:
            assumptions.append("TMR0 counts from the cycle after OPTION_REG is written")
        assumptions += [
            f"{channel.pin} is low while the program makes it an input"
            for channel in self._schedule.channels
            if self._chip.released >> PINS.index(channel.pin) & 1
        ]
        return tuple(assumptions)


def trims_text(schedule: PulseSchedule, bytes_of: dict[int, int]) -> str:
    """Return what a proof for any EEPROM is about."""
    trims = [(byte, schedule.channels[channel].pin) for channel, byte in bytes_of.items()]
    if not trims:
        return "the EEPROM holds anything: no pulse depends on it"
    named = ", ".join(f"{byte} of {pin}" for byte, pin in sorted(trims))
    return (
        "the EEPROM holds anything; each pulse is longer than the schedule's by the byte that is its trim, "
        f"in two's complement, 0xFF being none: byte {named}"
    )


def held_assumptions(held: Mapping[int, int], schedule: PulseSchedule) -> list[str]:
    """Return what is assumed of the pins that are held, by number of the pin and level."""
    return [
        f"{PINS[pin]} is held at {level}, as the schedule says: {_why_held(schedule)}"
        for pin, level in sorted(held.items())
    ]


def _why_held(schedule: PulseSchedule) -> str:
    return (
        "by request" if schedule.buttons or schedule.commands else "it does not say what another level does"
    )


def endless_wait(search: SearchResult) -> int | None:
    """Return a node from which the program can come back to it without a pulse."""
    graph: dict[int, list[int]] = {}
    for before, after, _ in search.waits:
        graph.setdefault(before, []).append(after)
        graph.setdefault(after, [])
    # No pulse is due before the first one, so each of these waits obeys the specification; only a cycle of
    # them means that the first pulse may never come.
    cycles = components(graph)
    return cycles[0][0] if cycles else None
