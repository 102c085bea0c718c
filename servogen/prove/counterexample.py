"""A violation of abstract states as a run of one chip, which can be repeated.

In: the way to a violation. Out: levels of the pins over time and the options of one chip with which the
plain simulator makes a wrong edge, or nothing where none was found: an abstract way need not be the way of
any real chip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from servogen.edges import HIGH, LOW, PINS, join
from servogen.engines.board import WIRE_HIGH, WIRE_QUIET_FRAMES
from servogen.pic.device import WATCHDOG_US
from servogen.pic.image import Image
from servogen.prove.chip import TIME_FIELDS, UNCERTAIN, AssumedBits
from servogen.prove.explore import SearchFinding
from servogen.prove.nodes import Node
from servogen.prove.quantifiers import ChipTrial, Quantifiers, trials
from servogen.prove.specification import BEFORE, Edge, Specification, Violation
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.pulse.schedule import POLL_CYCLES, START_FRAMES
from servogen.simulator import Levels, Machine, SimulatorOptions, Stimuli
from servogen.simulator.layout import FETCH, INTF, RBIF
from servogen.simulator.options import START_VALUES
from servogen.simulator.sources import Reset, SignalSource
from servogen.units import Clock

LONGEST_SLEEP = WATCHDOG_US[1] * 128
"""Cycles at 4 MHz until the slowest watchdog with the largest postscaler ends SLEEP."""
LATE = 4
"""Phases of a wire's rise to the program that awaits it."""
RB0, RB7 = PINS.index("RB0"), PINS.index("RB7")

Sample = tuple[int, int, int]
"""(cycle, pin, level): the program reads the pin in that cycle."""
AllLevels = tuple[tuple[str, tuple[tuple[int, int], ...]], ...]
"""By pin: (cycle, level)."""
_START_OF = {name: row for name, row in UNCERTAIN.items() if row.start and name not in TIME_FIELDS}
"""The row of the start value that a choice of a field may be of."""


@dataclass(frozen=True, slots=True)
class Counterexample:
    """One chip, with one stimulus, that violates the specification."""

    message: str
    cycle: int
    """Since power-on."""
    options: SimulatorOptions
    levels: AllLevels
    clock_hz: int | None = None
    """The frequency of this chip's oscillator; None: the schedule's."""
    reset: int | None = None
    """The cycle in which MCLR is low; None: in none."""
    eeprom: dict[int, int] | None = None
    """The bytes of the EEPROM that are not erased; None: as in the file."""

    def stimulus(self, clock: Clock) -> str:
        """Return the stimulus file for `servogen simulate`."""
        blocks = []
        for pin, changes in self.levels:
            times = ", ".join(_microseconds(clock, cycle) for cycle, _ in changes)
            values = ", ".join(str(level) for _, level in changes)
            blocks.append(f'[[level]]\npin = "{pin}"\nat_us = [{times}]\nlevel = [{values}]\n')
        if self.reset is not None:
            low, high = (_microseconds(clock, cycle) for cycle in (self.reset, self.reset + 1))
            blocks.append(f"[[reset]]\npressed_us = {low}\nreleased_us = {high}\n")
        return "\n".join(blocks)

    def arguments(self) -> list[str]:
        """Return the options for `servogen simulate`."""
        plain = SimulatorOptions()
        options = []
        for name in ("device", "watchdog_us", "eeprom_write_us", "floating", "start_seed", "tmr0_phase"):
            value = getattr(self.options, name)
            if value != getattr(plain, name):
                options += [f"--{name.replace('_', '-')}", str(value)]
        for name, value in self.options.start:
            options += ["--start", f"{name}={value}"]
        if self.clock_hz is not None:
            options += ["--clock-hz", str(self.clock_hz)]
        if self.options.ra4_pull_up:
            options.append("--ra4-pull-up")
        return options


def _microseconds(clock: Clock, cycle: int) -> str:
    number = clock.us(cycle)
    return str(int(number)) if number == int(number) else repr(float(number))


@dataclass(frozen=True, slots=True)
class Case:
    """What is to be shown wrong, and on which chips."""

    image: Image
    schedule: PulseSchedule
    spec: Specification
    board: SimulatorOptions
    quantifiers: Quantifiers
    held: Mapping[int, int]


def concrete(case: Case, nodes: Sequence[Node], finding: SearchFinding) -> Counterexample | None:
    """Return a run of one chip along the way of `finding`, or like it, that is wrong."""
    # The search knows only some bits of the chip. Those that it chose are set; what it left open is tried
    # with several values, and a plain run of the simulator decides whether an edge is wrong.
    path, others = path_to(nodes, finding), expected(case.schedule).others
    # What is read of a tape its EEPROM gives, which any run has.
    path.samples[:] = [sample for sample in path.samples if sample[1] not in others]
    end = path.end + (START_FRAMES if finding.silent else 2) * case.spec.period + path.waits * LONGEST_SLEEP
    board = replace(case.board, tmr0_phase=path.tmr0_phase)
    for trial in trials(board, case.quantifiers, path.start, case.spec.period):
        # The cycles of the path to the finding are counted from the first instruction after the last reset.
        begun = 0 if trial.reset is None else trial.reset + 1 + FETCH
        for falling in (False, True) if path.requests else (False,):
            changes = [*path.samples, *flag_changes(case, path.requests, falling)]
            levels = levels_of([(begun + cycle, pin, level) for cycle, pin, level in changes], case.held)
            every = pin_changes(trial_machine(case, trial, levels), begun, begun + end, case.spec.restart)
            edges = [edge for edge in every if edge[1] not in others]
            try:
                judge_run(case.spec, edges, path.samples, end)
            except Violation as violation:
                violation.cycle += begun
                if case.spec.is_shown(violation, dict(levels)):
                    cycle = violation.cycle
                    return Counterexample(violation.message, cycle, trial.options, levels, reset=trial.reset)
                if violation.certain:
                    return None  # on every chip, only what it reads tells that this is wrong
    return None


def regular_wire(case: Case) -> Counterexample | None:
    """Return a wire that rises once a frame after which the first edge does not come in its cycle, if one of
    some is such.
    """
    rule, period = case.schedule.wire, int(case.schedule.period)
    if rule is None:
        return None
    for late in range(LATE):
        rises = [(WIRE_QUIET_FRAMES + frame) * period + late for frame in range(rule.frames + 2)]
        changes = [(rise + each * int(WIRE_HIGH * period), 1 - each) for rise in rises for each in (0, 1)]
        levels = ((rule.pin, ((0, 0), *changes)),)
        due = rises[rule.frames] + int(rule.cycles)
        edges = pin_changes(trial_machine(case, ChipTrial(case.board), levels), 0, due + period)
        first = next((cycle for cycle, _, level in edges if level), None)
        if first is None or not 0 <= first - due < (POLL_CYCLES if rule.crystal_ppm else 1):
            return Counterexample(
                f"the first pulse comes in cycle {first}, not in {due}" if first else "no pulse comes",
                due,
                case.board,
                levels,
            )
    return None


def flag_changes(case: Case, requests: Sequence[tuple[int, int]], falling: bool) -> list[Sample]:
    """Return the levels of RB0, and of a free pin of RB4 to RB7, that set flags of INTCON in these cycles."""
    taken = {channel.pin for channel in case.schedule.channels}
    free = [pin for pin in range(RB7, RB7 - 4, -1) if PINS[pin] not in taken and pin not in case.held]
    samples: list[Sample] = []
    moments = [cycle for cycle, flags in requests if flags & INTF]
    if moments:
        samples.append((0, RB0, int(falling)))
    for cycle in moments:
        # INTEDG may select either edge of RB0: both are tried.
        samples += [(cycle, RB0, 1 - falling), (cycle + 1, RB0, int(falling))]
    changes = [cycle for cycle, flags in requests if flags & RBIF]
    if changes and free:
        samples.append((0, free[0], 0))
        samples += [(cycle, free[0], (number + 1) % 2) for number, cycle in enumerate(changes)]
    return samples


def slow_oscillator(case: Case) -> Counterexample | None:
    """Return a chip whose RC oscillator is a tenth slow, and the first fall that is late by it."""
    slow = case.schedule.clock.hz * 9 // 10
    levels = levels_of((), case.held)
    edges = pin_changes(
        trial_machine(case, ChipTrial(case.board), levels), 0, START_FRAMES * case.spec.period
    )
    rise = next((edge for edge in edges if edge[2]), None)
    fall = next((edge for edge in edges if rise and edge[1] == rise[1] and not edge[2]), None)
    if rise is None or fall is None:
        return None
    wanted = float(case.schedule.clock.us(fall[0] - rise[0]))
    message = (
        f"an RC oscillator differs from chip to chip; one of {slow} Hz makes the first pulse of "
        f"{PINS[fall[1]]} {wanted * 10 / 9:.1f} us long instead of {wanted:.1f}"
    )
    return Counterexample(message=message, cycle=fall[0], options=case.board, levels=levels, clock_hz=slow)


def stimuli_of(trial: ChipTrial, levels: AllLevels) -> Stimuli | None:
    """Return the levels, and the trial's reset, as what drives the pins."""
    sources: list[SignalSource] = [Levels(PINS.index(pin), changes) for pin, changes in levels]
    if trial.reset is not None:
        sources.append(Reset(trial.reset, trial.reset + 1))
    return Stimuli(sources) if sources else None


def trial_machine(case: Case, trial: ChipTrial, levels: AllLevels) -> Machine:
    """Return a chip at power-up with these levels at its pins."""
    return Machine(case.image, case.schedule.clock, trial.options, stimuli_of(trial, levels))


@dataclass(slots=True)
class _Path:
    """What was chosen on the way to a finding: the levels read, how TMR0 begins, and start values."""

    samples: list[Sample] = field(default_factory=list)
    requests: list[tuple[int, int]] = field(default_factory=list)
    """(cycle, flags of INTCON that pins set then)."""
    waits: int = 0
    """How often the watchdog ends SLEEP."""
    tmr0_phase: int = 0
    start: dict[str, int] = field(default_factory=dict)
    end: int = 0
    """The cycle of the finding, from reset on."""
    _known: dict[str, int] = field(default_factory=dict)

    def note_start(self, choice: AssumedBits) -> None:
        """Note bits that were chosen; the first choice of a bit may be of its value at power-up."""
        row = _START_OF.get(choice.register)
        name, shift = (row.start, row.shift) if row else (choice.field, 0)  # a byte of RAM has one name
        if name not in START_VALUES:
            return
        fresh = choice.bits >> shift & ~self._known.get(name, 0) & START_VALUES[name]
        self._known[name] = self._known.get(name, 0) | fresh
        self.start[name] = self.start.get(name, 0) | choice.value >> shift & fresh


def path_to(nodes: Sequence[Node], finding: SearchFinding) -> _Path:
    """Return what was chosen from reset on."""
    ancestry = [finding.node]
    while nodes[ancestry[-1]].parent >= 0:
        ancestry.append(nodes[ancestry[-1]].parent)
    ancestry.reverse()
    path = _Path()
    parts = [(nodes[number].cycles, nodes[number].decisions) for number in ancestry[1:]]
    for cycles, decisions in [*parts, (finding.cycle, finding.decisions)]:
        for decision in decisions:
            for choice in decision.choices:
                cycle = path.end + decision.cycle
                if choice.field == "PINS":
                    pin = choice.bits.bit_length() - 1
                    path.samples.append((cycle, pin, int(choice.value != 0)))
                elif choice.field.startswith("INTCON"):
                    if choice.value:
                        path.requests.append((cycle + int(choice.field == "INTCON_LATE"), choice.value))
                elif choice.field == "WATCHDOG":
                    path.waits += 1
                elif choice.field == "TMR0_PHASE":
                    path.tmr0_phase = choice.value
                else:
                    path.note_start(choice)
        path.end += cycles
    return path


def levels_of(samples: Sequence[Sample], held_levels: Mapping[int, int]) -> AllLevels:
    """Return the pins' levels: each from the cycle of its reading on, the first from the beginning."""
    levels: dict[int, list[tuple[int, int]]] = {pin: [(0, level)] for pin, level in held_levels.items()}
    for cycle, pin, level in sorted(samples):
        changes = levels.setdefault(pin, [(0, level)])
        if changes[-1][1] != level:
            changes.append((cycle, level))
    return tuple((PINS[pin], tuple(changes)) for pin, changes in sorted(levels.items()))


def pin_changes(machine: Machine, begun: int, end: int, restart: int | None = None) -> list[Edge]:
    """Return the changes of the pins from cycle `begun` on, in cycles since it; the pin `restart` is 1 while
    it is pulled low.
    """
    chunk = join(machine.stream(end))
    high = 0
    edges = []
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
        now = int(level == (LOW if pin == restart else HIGH))
        if high >> pin & 1 != now:
            high ^= 1 << pin
            if cycle >= begun:
                edges.append((cycle - begun, pin, now))
    return edges


def judge_run(spec: Specification, edges: list[Edge], samples: Sequence[Sample], end: int) -> None:
    """Follow one run. Raises Violation, whose cycle counts from reset."""
    state = spec.start()
    begun, place = 0, 0
    for cycle, pin, level in [*sorted(samples), (end, -1, 0)]:
        part = []
        while place < len(edges) and edges[place][0] < cycle:
            part.append((edges[place][0] - begun, edges[place][1], edges[place][2]))
            place += 1
        try:
            state = spec.advance(state, part, cycle - begun)
        except Violation as violation:
            violation.cycle += begun
            raise
        begun = cycle
        if pin >= 0:
            state = spec.sample(state, pin, level)
    if state.phase == BEFORE and end >= START_FRAMES * spec.period:
        raise Violation("no pulse comes", end)
