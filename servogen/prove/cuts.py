"""The choice of cut points, and of the bytes that are dead there: guesses from one run with the inputs held.

In: an image and a schedule. Out: cut points with guesses. A good cut point is met once in a frame and has few
live bytes: in a player it is the beginning of the next frame's widths.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from servogen.edges import HIGH, PINS
from servogen.engines.board import machine_of
from servogen.pic.image import Image
from servogen.prove.chip import FIELD, ChipState, Reason, Use
from servogen.prove.forks import Choices, PreparedProgram, before_instruction, ways_of
from servogen.prove.generalise import Guess, follows_timer, live_places
from servogen.prove.specification import BEFORE, IN_FRAME, Specification, SpecState, Violation
from servogen.prove.transitions import Ram, Transitions, applied
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.pulse.schedule import START_FRAMES
from servogen.simulator import profile

SAMPLE_FRAMES = 120
"""Frames from which the cut point is chosen."""
MOTION_FRAMES = 4000
"""Frames whose first edges are looked at."""
TRIED = 24
"""Candidates for the cut point that are looked at closely."""
TRIED_FRAMES = 12
WALKED_FRAMES = 400
STEPS_PER_CUT = 30
"""Runs between two cuts: a program whose every instruction an interrupt may follow has more."""
AWAITED_STEPS = 50_000
"""Runs until the wire of another chip has risen, as soon as it may, and the first pulses are due."""
ALL_PLACES = frozenset(range(68))


@dataclass(slots=True)
class _Walk:
    """A run from cut to cut: what each part read first and wrote, and the state before it.

    `sampled`: the number of cuts at which a button has been read whose level counts at the frame's end.
    """

    pcs: list[int]
    reads: list[frozenset[int]]
    writes: list[frozenset[int]]
    states: list[tuple[Ram, int]]
    sampled: int = 0
    awaited: int = 0
    """The number of parts before the pulses, in which the program awaits the wire of another chip."""

    @property
    def half(self) -> int:
        """Return the parts in which liveness is exact: after the walk's end everything counts as live."""
        return max(1, self.awaited + (len(self.reads) - self.awaited) // 2)


@dataclass(frozen=True, slots=True)
class _Begin:
    """Where walks begin: at reset, or where the wire of another chip has risen, with what was read first and
    written since it was first read, at `pc`.
    """

    ram: Ram
    rest: int
    position: SpecState
    pc: int = -1
    reads: frozenset[int] = frozenset()
    writes: frozenset[int] = frozenset()


def first_edges(
    image: Image, schedule: PulseSchedule, frames: int, silence: int
) -> tuple[int, set[int]] | None:
    """Return the cycle of the first pulse, and the addresses after the first edges of `frames` frames."""
    machine = machine_of(schedule, image)
    first = next((chunk for chunk in expected(schedule).chunks if len(chunk.cycle)), None)
    if first is None:
        return None
    pin = int(first.pin[0])
    start = machine.run_to_edge(pin, HIGH, START_FRAMES * schedule.period)
    if start is None:
        return None
    addresses = {machine.pc & 0x3FF}
    for _ in range(frames):
        if machine.run_to_edge(pin, HIGH, silence) is None:
            break
        addresses.add(machine.pc & 0x3FF)
    return int(start), addresses


def rising_addresses(image: Image, schedule: PulseSchedule) -> frozenset[int]:
    """Return the addresses of the instructions that begin a pulse while no other pin is high, of the first
    frame with pulses.
    """
    pulses = next((run.pulses for run in (*schedule.lead_in, *schedule.loop) if any(run.pulses)), ())
    due = [(int(p.rise), int(p.rise + p.width), n) for n, p in enumerate(pulses) if p is not None]
    addresses, free = set(), -1
    for rise, fall, number in sorted(due):
        if rise > free:
            machine = machine_of(schedule, image)
            pin = PINS.index(schedule.channels[number].pin)
            if machine.run_to_edge(pin, HIGH, START_FRAMES * schedule.period) is not None:
                addresses.add(machine.pc - 1 & 0x3FF)
        free = max(free, fall)
    return frozenset(addresses)


def once_a_frame(image: Image, schedule: PulseSchedule, start: int) -> list[int]:
    """Return the addresses that are executed once in each frame of the sample, evenly chosen."""
    machine = machine_of(schedule, image)
    machine.run(start + schedule.period // 2)
    profiled = profile(machine, SAMPLE_FRAMES * schedule.period)
    once = [
        address for address, spent in profiled.words.items() if abs(spent.executions - SAMPLE_FRAMES) <= 1
    ]
    if len(once) <= TRIED:
        return sorted(once)
    return [sorted(once)[n] for n in np.linspace(0, len(once) - 1, TRIED).astype(int)]


def choose_cuts(
    program: PreparedProgram,
    transitions: Transitions,
    schedule: PulseSchedule,
    spec: Specification,
    always: frozenset[int],
) -> dict[int, Guess]:
    """Return the cut points with what is probably dead there; none where the program has no pulses."""
    beginning = first_edges(program.image, schedule, min(spec.frames, MOTION_FRAMES), spec.longest_silence)
    if beginning is None:
        return {}
    start, fallback = beginning
    levels = {PINS.index(source.pin): source.level for source in schedule.inputs}
    if schedule.tape is not None:
        levels[PINS.index(schedule.tape.sda)] = 1  # nobody holds it
    begin = _begin(program, transitions, spec, always, levels)
    best: list[int] = sorted(fallback)
    fewest = (True, 1 << 30)
    for candidate in once_a_frame(program.image, schedule, start):
        walk = _walk(program, transitions, spec, {candidate}, always, levels, begin, TRIED_FRAMES)
        if walk is None:
            continue
        live = live_places(walk.reads, walk.writes, ALL_PLACES)
        count = max((len(places) for places in live[walk.awaited : walk.half]), default=1 << 20)
        # After a button was read there are two states for each one before; runs that differ in W are not
        # shared.
        rank = 2 * walk.sampled > len(walk.pcs) or needs_w(program, candidate), count
        if rank < fewest:
            best, fewest = [candidate], rank
    walk = _walk(program, transitions, spec, set(best), always, levels, begin, WALKED_FRAMES)
    best += [begin.pc] * (begin.pc >= 0)
    return {pc: Guess() for pc in best} if walk is None else _guesses(transitions, best, walk)


def needs_w(program: PreparedProgram, pc: int) -> bool:
    """Return whether the instructions from `pc` on read W before they write it, as far as there is one way.

    Calls are followed: a table that is called reads its index in W.
    """
    seen: set[int] = set()
    while pc not in seen and (decoded := program.at(pc)) is not None:
        seen.add(pc)
        row = decoded.instruction
        if "W" in row.reads:
            return True
        if "W" in row.writes or (row.writes == "d" and not decoded.d):
            return False
        if row.flow in ("jump", "call"):
            pc = decoded.k
        elif row.flow == "next":
            pc += 1
        else:
            return False
    return False


def _guesses(transitions: Transitions, cuts: list[int], walk: _Walk) -> dict[int, Guess]:
    live = live_places(walk.reads, walk.writes, ALL_PLACES)
    guesses = {}
    for pc in cuts:
        rows = [n for n in range(walk.half) if walk.pcs[n] == pc]
        dead = ALL_PLACES.difference(*(live[n] for n in rows)) if rows else frozenset()
        guess = Guess(set(dead))
        states = [walk.states[n] for n in range(len(walk.pcs)) if walk.pcs[n] == pc]
        timers = [transitions.rest(rest)[FIELD["TMR0"]] for _, rest in states]
        known = all(transitions.rest(rest)[FIELD["TMR0_UNKNOWN"]] == 0 for _, rest in states)
        # With fewer phases of TMR0 it is cheaper to keep them apart than to follow the distance.
        if known and len(set(timers)) >= 16:
            guess.phased = {
                place
                for place in sorted(ALL_PLACES - dead)
                if follows_timer([ram[place] for ram, _ in states], timers)
            }
        guesses[pc] = guess
    return guesses


def _begin(
    program: PreparedProgram,
    transitions: Transitions,
    spec: Specification,
    always: frozenset[int],
    levels: Mapping[int, int],
) -> _Begin:
    """Return where walks begin."""
    transitions.stop_at(always)
    start = transitions.chip.power_on()
    here = _Begin(start.ram, transitions.number(start.rest), spec.start())
    if not spec.likely(here.position):
        return here
    for step in _steps(program, transitions, spec, levels, here, AWAITED_STEPS):
        if here.pc < 0 and step.position.phase != BEFORE:
            here = replace(here, pc=step.pc)
        if here.pc >= 0:
            reads = here.reads | step.reads - here.writes
            here = replace(here, reads=reads, writes=here.writes | step.writes)
        if step.position.phase == IN_FRAME:
            return replace(here, ram=step.ram, rest=step.rest, position=step.position)
    return replace(here, pc=-1)


@dataclass(frozen=True, slots=True)
class _Step:
    """One run of a walk, from `pc` on: what it read first and wrote, and the state after it, in which
    something unknown may decide.
    """

    pc: int
    reads: frozenset[int]
    writes: frozenset[int]
    ram: Ram
    rest: int
    position: SpecState
    use: Use | None


def _steps(
    program: PreparedProgram,
    transitions: Transitions,
    spec: Specification,
    levels: Mapping[int, int],
    begin: _Begin,
    most: int,
) -> Iterator[_Step]:
    """Yield the runs of one way, `most` at most; it ends where the search will find something."""
    ram, rest, position = begin.ram, begin.rest, begin.position
    use: Use | None = None
    chosen: Choices = ()
    for _ in range(most):
        state, pc = ChipState(ram, transitions.rest(rest)), transitions.pc(rest)
        ways = ways_of(program, state, use, chosen) if use else None
        if use is None:
            told = frozenset(levels) | spec.sampled
            ways = before_instruction(program, state, told, 1) if pc in transitions.stops else [()]
        if not ways:
            return
        now = {**levels, **spec.likely(position)}
        choices = next((candidate for candidate in ways if _as_held(candidate, now)), ways[0])
        outcome = transitions.run(ram, rest, choices)
        if outcome.reason is Reason.USE and not outcome.cycles:
            if outcome.use is None or len(chosen) > 12:
                return
            use, chosen = outcome.use, choices
            continue
        try:
            for choice in choices:
                if choice.field == "PINS":
                    pin, level = choice.bits.bit_length() - 1, int(choice.value != 0)
                    position = spec.sample(position, pin, level)
            position = spec.advance(position, outcome.edges, outcome.cycles)
        except Violation:
            return
        ram, rest, use, chosen = applied(ram, outcome), transitions.number(outcome.rest), outcome.use, ()
        if outcome.reason in (Reason.WARNING, Reason.LIMIT, Reason.NEVER):
            return
        written = frozenset(place for place, _ in outcome.written)
        yield _Step(pc, frozenset(outcome.read), written, ram, rest, position, use)


def _walk(
    program: PreparedProgram,
    transitions: Transitions,
    spec: Specification,
    cuts: set[int],
    always: frozenset[int],
    levels: Mapping[int, int],
    begin: _Begin,
    count: int,
) -> _Walk | None:
    """Follow one way from its beginning through `count` cuts; None if none is met twice."""
    transitions.stop_at(always | cuts)
    walk = _Walk([], [], [], [])
    if begin.pc >= 0:
        walk = _Walk([begin.pc], [begin.reads], [begin.writes], [(begin.ram, begin.rest)], awaited=1)
    for step in _steps(program, transitions, spec, levels, begin, STEPS_PER_CUT * (count + 2)):
        if walk.reads:
            walk.reads[-1] |= step.reads - walk.writes[-1]
            walk.writes[-1] |= step.writes
        if transitions.pc(step.rest) in cuts and step.use is None:
            walk.pcs.append(transitions.pc(step.rest))
            walk.reads.append(frozenset())
            walk.writes.append(frozenset())
            walk.states.append((step.ram, step.rest))
            walk.sampled += step.position.is_sampled
        if len(walk.reads) > count:
            break
    return walk if len(walk.reads) > 2 else None


def _as_held(choices: Choices, levels: Mapping[int, int]) -> bool:
    """Return whether every pin of a way has the level that the schedule says."""
    return all(
        levels.get(choice.bits.bit_length() - 1, 0) == int(choice.value != 0)
        for choice in choices
        if choice.field == "PINS"
    )
