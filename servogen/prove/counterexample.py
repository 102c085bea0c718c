"""A violation of abstract states as a run of one chip, which anybody can repeat.

In: the way to a violation. Out: levels of the pins over time and the options of one chip with which the
plain simulator makes a wrong edge, or nothing where none was found: an abstract way need not be the way of
any chip.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from servogen.edges import PINS, join
from servogen.pic.image import Image
from servogen.prove.explore import Finding, Node
from servogen.prove.specification import BEFORE, START_FRAMES, Edge, Specification, Violation
from servogen.pulse import PulseSchedule
from servogen.simulator import Levels, Machine, Options, Stimuli
from servogen.simulator.unknown import INTF, RBIF

SEEDS = 64
"""Start states that are tried."""
SHORTEST_WATCHDOG_US = 7000
RB0, RB7 = PINS.index("RB0"), PINS.index("RB7")

Sample = tuple[int, int, int]
"""(cycle, pin, level): the program reads the pin in that cycle."""


@dataclass(frozen=True, slots=True)
class Counterexample:
    """One chip, with one stimulus, that violates the specification."""

    message: str
    cycle: int
    """Since reset."""
    options: Options
    levels: tuple[tuple[str, tuple[tuple[int, int], ...]], ...]
    """By pin: (cycle, level)."""
    clock_hz: int | None = None
    """The frequency of this chip's oscillator; None: the schedule's."""

    def stimulus(self, schedule: PulseSchedule) -> str:
        """Return the stimulus file for `servogen simulate`."""
        blocks = []
        for pin, changes in self.levels:
            times = ", ".join(_microseconds(schedule, cycle) for cycle, _ in changes)
            values = ", ".join(str(level) for _, level in changes)
            blocks.append(f'[[level]]\npin = "{pin}"\nat_us = [{times}]\nlevel = [{values}]\n')
        return "\n".join(blocks)

    def arguments(self) -> list[str]:
        """Return the options for `servogen simulate`."""
        plain = Options()
        found = []
        for name in ("device", "watchdog_us", "ram", "floating", "start_seed", "tmr0_phase"):
            value = getattr(self.options, name)
            if value != getattr(plain, name):
                found += [f"--{name.replace('_', '-')}", str(value)]
        if self.clock_hz is not None:
            found += ["--clock-hz", str(self.clock_hz)]
        if self.options.ra4_pull_up:
            found.append("--ra4-pull-up")
        return found


def _microseconds(schedule: PulseSchedule, cycle: int) -> str:
    number = schedule.clock.us(cycle)
    return str(int(number)) if number == int(number) else repr(float(number))


def concrete(
    image: Image,
    schedule: PulseSchedule,
    spec: Specification,
    board: Options,
    held: Mapping[int, int],
    nodes: Sequence[Node],
    finding: Finding,
) -> Counterexample | None:
    """Return a run of one chip along the way of `finding`, or like it, that is wrong."""
    samples, phase, end = _way(nodes, finding)
    end += START_FRAMES * spec.period if finding.silent else 2 * spec.period
    levels = _levels(samples, held)
    stimuli = Stimuli([Levels(PINS.index(pin), changes) for pin, changes in levels]) if levels else None
    for options in _chips(replace(board, tmr0_phase=phase)):
        machine = Machine(image, schedule.clock, options, stimuli)
        edges = _edges(machine, end)
        try:
            _judge(spec, edges, samples, end)
        except Violation as violation:
            if violation.certain:
                return Counterexample(violation.message, violation.cycle, options, levels)
    return None


def slow_oscillator(
    image: Image, schedule: PulseSchedule, spec: Specification, board: Options, held: Mapping[int, int]
) -> Counterexample | None:
    """Return a chip whose RC oscillator is a tenth slow, and the first fall that is late by it."""
    slow = schedule.clock.hz * 9 // 10
    levels = _levels((), held)
    stimuli = Stimuli([Levels(PINS.index(pin), changes) for pin, changes in levels]) if levels else None
    machine = Machine(image, schedule.clock, board, stimuli)
    edges = _edges(machine, START_FRAMES * spec.period)
    rise = next((edge for edge in edges if edge[2]), None)
    fall = next((edge for edge in edges if rise and edge[1] == rise[1] and not edge[2]), None)
    if rise is None or fall is None:
        return None
    wanted = float(schedule.clock.us(fall[0] - rise[0]))
    message = (
        f"an RC oscillator differs from chip to chip; one of {slow} Hz makes the first pulse of "
        f"{PINS[fall[1]]} {wanted * 10 / 9:.1f} us long instead of {wanted:.1f}"
    )
    return Counterexample(message, fall[0], board, levels, slow)


def _way(nodes: Sequence[Node], finding: Finding) -> tuple[list[Sample], int, int]:
    """Return what the program reads on the way, how TMR0 begins, and when the violation is, from reset on."""
    path = [finding.node]
    while nodes[path[-1]].parent >= 0:
        path.append(nodes[path[-1]].parent)
    path.reverse()
    samples: list[Sample] = []
    phase, begun = 0, 0
    parts = [(nodes[number].cycles, nodes[number].decisions) for number in path[1:]]
    for cycles, decisions in [*parts, (finding.cycle, finding.decisions)]:
        for decision in decisions:
            for choice in decision.choices:
                if choice.field == "PINS":
                    pin = choice.bits.bit_length() - 1
                    samples.append((begun + decision.cycle, pin, int(choice.value != 0)))
                elif choice.field.startswith("INTCON") and choice.value:
                    late = int(choice.field == "INTCON_LATE")
                    samples += _flag_set(choice.value, begun + decision.cycle + late)
                elif choice.field == "TMR0_PHASE":
                    phase = choice.value
        begun += cycles
    return samples, phase, begun


def _flag_set(flags: int, cycle: int) -> list[Sample]:
    """Return the levels of pins that set INTF or RBIF in a cycle."""
    if flags & INTF:
        return [(0, RB0, 0), (cycle, RB0, 1), (cycle + 1, RB0, 0)]
    if flags & RBIF:
        return [(0, RB7, 0), (cycle, RB7, 1)]
    return []


def _levels(
    samples: Sequence[Sample], held: Mapping[int, int]
) -> tuple[tuple[str, tuple[tuple[int, int], ...]], ...]:
    """Return the pins' levels: each from the cycle of its reading on, the first from the beginning."""
    found: dict[int, list[tuple[int, int]]] = {pin: [(0, level)] for pin, level in held.items()}
    for cycle, pin, level in sorted(samples):
        changes = found.setdefault(pin, [(0, level)])
        if changes[-1][1] != level:
            changes.append((cycle, level))
    return tuple((PINS[pin], tuple(changes)) for pin, changes in sorted(found.items()))


def _chips(board: Options) -> Iterator[Options]:
    yield board
    for ram in (0xFF, 0x55, 0xAA):
        yield replace(board, ram=ram)
    yield replace(board, floating=1)
    yield replace(board, watchdog_us=SHORTEST_WATCHDOG_US)
    for seed in range(SEEDS):
        yield replace(board, start_seed=seed)
        yield replace(board, start_seed=seed, floating=1)


def _edges(machine: Machine, end: int) -> list[Edge]:
    chunk = join(machine.stream(end))
    high = 0
    found = []
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
        now = int(level == 1)
        if high >> pin & 1 != now:
            high ^= 1 << pin
            found.append((cycle, pin, now))
    return found


def _judge(spec: Specification, edges: list[Edge], samples: Sequence[Sample], end: int) -> None:
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
