"""An attack on what `servogen prove` says of two chips: a pair that goes wrong must not be proven.

    python -m tests.prove.pair_attack --mutants 200 --seed 1

One or two words of either chip's program are changed, or the wire's timing: its rule in the second one's
schedule, or the first one's pulses. The simulator runs the pair with random RAM, registers and phases of
TMR0, phases of one chip to the other, resets of either, and a wire that is held, mended, cut, early or late.
`wire_judge`, which knows neither the prover nor what a program reads, says whether the second chip may do
what it does; the first one's pulses are compared with its schedule. A mutant that goes wrong is given to the
prover. Nine of ten are of `wired`, whose frames are short, the tenth is of a job's two players. Exit code 1
if one is proven, or if a counterexample is none.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

from servogen.edges import HIGH, PINS, EdgeTrace, edge_chunk, join
from servogen.engines.board import board_of
from servogen.job import loads, plan_job
from servogen.pic.image import Image
from servogen.prove import Counterexample
from servogen.pulse import PulseSchedule
from servogen.pulse.expected import expected
from servogen.pulse.schedule import Pulse
from servogen.simulator import Levels, Machine, Reset, SimulatorOptions, Stimuli, parse_stimuli
from servogen.simulator.sources import SignalSource
from servogen.units import Cycles
from servogen.verify import verify
from servogen.workflows.pair import planned_pair
from servogen.workflows.pair_proof import PairProof, prove_pair
from tests.prove.replay import is_wrong
from tests.prove.wire_judge import fault, level_at
from tests.prove.wired import first_chip, schedules, second_chip

Edge = tuple[int, int, int]
"""(cycle, pin, level)."""
Wire = list[tuple[int, int]]
"""(cycle, level from then on)."""
FRAMES, ENVIRONMENTS, MAX_STATES = 22, 12, 3000
SETTLING = 40
"""Cycles after a reset in which a pin may have an unknown level, for a few of them (docs/proof.md)."""
RESET = 50
"""Cycles for which MCLR is low."""
JOB = """
[[chip]]
device = "PIC16F84"
clock_hz = 4_000_000
wire = "RB0"
[[chip]]
device = "PIC16F84"
clock_hz = 4_000_000
wire = "RA1"
[[servo]]
name = "a"
pin = "RB0"
model = "mpx-tiny-s"
[[servo]]
name = "b"
pin = "RB0"
model = "mpx-tiny-s"
[motion]
poses = [
    { a_deg = 60, b_deg = 120, move_s = 0.06, hold_s = 0.02 },
    { a_deg = 90, b_deg = 70, move_s = 0.06, hold_s = 0.02 },
]
[firmware]
soft_start_s = 0.08
"""


@dataclass(frozen=True)
class Pair:
    """Two chips and their schedules."""

    images: tuple[Image, Image]
    schedules: tuple[PulseSchedule, PulseSchedule]

    @property
    def period(self) -> int:
        return int(self.schedules[0].period)


@cache
def pair(name: str) -> Pair:
    """The right programs."""
    if name == "counted":
        return Pair((first_chip(), second_chip()), schedules())
    played = planned_pair(plan_job(loads(JOB, "pair.toml")))
    first, second = (made.compilation.image for made in played.firmware())
    return Pair((first, second), played.schedules)


# Mutants ---------------------------------------------------------------------------------------------------


def with_other_words(image: Image, count: int, rng: random.Random) -> Image:
    """One bit of each of `count` words is another, or the whole word."""
    program = dict(image.program)
    for address in rng.sample(sorted(program), count):
        bits = 1 << rng.randrange(14) if rng.random() < 0.7 else rng.randrange(1, 1 << 14)
        program[address] ^= bits
    return replace(image, program=program)


def with_other_timing(right: Pair, rng: random.Random) -> Pair:
    """The second chip's rule, or a pulse of the wire, is another; both programs are as they were."""
    first, second = right.schedules
    rule = second.wire
    assert rule is not None
    kind = rng.randrange(4)
    if kind == 0:
        cycles = Cycles(rule.cycles + rng.choice((-3, -2, -1, 1, 2, 3, 17)))
        return replace(right, schedules=(first, replace(second, wire=replace(rule, cycles=cycles))))
    if kind == 1:
        frames = rule.frames + rng.choice((-2, -1, 1, 2))
        return replace(right, schedules=(first, replace(second, wire=replace(rule, frames=frames))))
    names = [channel.pin for channel in first.channels]
    channel, number = names.index(rule.source), rng.randrange(len(first.loop))
    run = first.loop[number]
    pulse = run.pulses[channel]
    assert pulse is not None
    early = rng.choice((-1, 1)) if kind == 2 else 0
    other = Pulse(Cycles(pulse.rise + max(early, -pulse.rise)), Cycles(pulse.width + rng.choice((-1, 1, 5))))
    pulses = (*run.pulses[:channel], other, *run.pulses[channel + 1 :])
    loop = (*first.loop[:number], replace(run, pulses=pulses), *first.loop[number + 1 :])
    return replace(right, schedules=(replace(first, loop=loop), second))


def mutant(right: Pair, kind: str, rng: random.Random) -> Pair:
    first, second = right.images
    if kind == "timing":
        return with_other_timing(right, rng)
    words = rng.choice((1, 1, 2))
    if kind == "first":
        return replace(right, images=(with_other_words(first, words, rng), second))
    return replace(right, images=(first, with_other_words(second, words, rng)))


# Runs ------------------------------------------------------------------------------------------------------


def edges_of(image: Image, schedule: PulseSchedule, board: SimulatorOptions, *sources: SignalSource,
             end: int) -> list[Edge]:  # fmt: skip
    """The changes of the pins, undriven ones being low."""
    chunk = join(Machine(image, schedule.clock, board, Stimuli(sources)).stream(Cycles(end)))
    found, high = [], 0
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
        if (high >> pin & 1) != (level == HIGH):
            high ^= 1 << pin
            found.append((cycle, pin, int(level == HIGH)))
    return found


def some_chip(schedule: PulseSchedule, rng: random.Random) -> SimulatorOptions:
    seed = rng.choice((None, rng.randrange(1 << 20)))
    return replace(board_of(schedule), start_seed=seed, tmr0_phase=rng.randrange(4))


def wire_of(pair: Pair, edges: list[Edge]) -> Wire:
    """The levels of the first chip's pin of the wire."""
    rule = pair.schedules[1].wire
    assert rule is not None
    source = PINS.index(rule.source)
    return [(0, 0), *((cycle, level) for cycle, pin, level in edges if pin == source)]


def held(wire: Wire, begin: int, end: int, level: int) -> Wire:
    """The wire held at a level for a time."""
    kept = [change for change in wire if not begin <= change[0] < end]
    return sorted([*kept, (begin, level), (end, level_at(wire, end))])


def moved(wire: Wire, begin: int, cycles: int) -> Wire:
    """The wire later from a cycle on."""
    return [(cycle + (cycles if cycle >= begin else 0), level) for cycle, level in wire]


def disturbed(wire: Wire, period: int, rng: random.Random) -> Wire:
    """The wire with something done to it."""
    rises = [cycle for cycle, level in wire if level]
    rise = rng.choice(rises)
    kind = rng.randrange(6)
    if kind == 0:
        return moved(wire, rise, rng.choice((-2, -1, 1, 2, rng.randrange(period))))
    if kind == 1:  # a pulse is missing, or the wire is low for longer
        return held(wire, rise - 20, rise + rng.choice((period // 2, 3 * period, 12 * period)), 0)
    if kind == 2:
        return held(wire, rise - rng.randrange(period // 2), rise + rng.choice((period // 2, 4 * period)), 1)
    if kind == 3:  # one cycle around a rise
        at = rise + rng.randrange(-3, 4)
        return held(wire, at, at + 1, rng.randrange(2))
    if kind == 4:
        at = rng.randrange(rises[-1])
        return held(wire, at, at + rng.choice((1, 7, 100)), rng.randrange(2))
    return wire


def second_goes_wrong(case: Pair, wire: Wire, image: Image, rng: random.Random) -> str:
    """What the second chip does wrong in one run; empty if nothing."""
    schedule, period = case.schedules[1], case.period
    assert schedule.wire is not None
    wire = moved(wire, 1, rng.randrange(period))
    for _ in range(rng.choice((0, 1, 1, 2))):
        wire = disturbed(wire, period, rng)
    end = wire[-1][0] - period
    reset = rng.randrange(end) if rng.random() < 0.3 else end
    sources = [Levels(PINS.index(schedule.wire.pin), wire), Reset(reset, reset + RESET)]
    channels = [channel.pin for channel in schedule.channels]
    edges = [
        (cycle, channels.index(PINS[pin]) if PINS[pin] in channels else -1, level)
        for cycle, pin, level in edges_of(image, schedule, some_chip(schedule, rng), *sources, end=end)
    ]
    lives = [(0, reset), (reset + RESET, end)] if reset + RESET < end else [(0, end)]
    for start, stop in lives:
        its = [edge for edge in edges if edge[0] >= start + SETTLING]
        wrong = fault(schedule, wire, its, start, stop)
        if wrong:
            return wrong
    return ""


def first_goes_wrong(case: Pair, image: Image, rng: random.Random) -> str:
    """What the first chip does wrong in one run."""
    schedule, board = case.schedules[0], some_chip(case.schedules[0], rng)
    end = (FRAMES + 40) * case.period
    edges = [edge for edge in edges_of(image, schedule, board, end=end) if edge[0] >= SETTLING]
    span = Cycles(end)
    chunk = edge_chunk(*(list(column) for column in zip(*edges, strict=True))) if edges else None
    if chunk is None:
        return "no pulse comes"
    checked = Cycles(FRAMES * case.period)
    return (
        ""
        if verify(expected(schedule), EdgeTrace(schedule.clock, [chunk], span), checked).agrees
        else "other edges"
    )


def pair_goes_wrong(case: Pair, rng: random.Random) -> str:
    """What a reset of the first chip leads to, if the second one does not begin again, in its cycle."""
    first, second = case.schedules
    rule, period = second.wire, case.period
    assert rule is not None
    end = (FRAMES + 40) * period
    wire = wire_of(case, edges_of(case.images[0], first, some_chip(first, rng), end=end))
    rises = [cycle for cycle, level in wire if level]
    if not rises:
        return "no rise of the wire"
    reset = rises[0] + rng.randrange(8 * period)
    again = [(cycle + reset, level) for cycle, level in wire if cycle]
    wire = [*(change for change in wire if change[0] < reset), (reset, 0), *again]
    begin = reset + rises[0] + rule.frames * period + int(rule.cycles)
    sources = [Levels(PINS.index(rule.pin), wire)]
    edges = edges_of(case.images[1], second, some_chip(second, rng), *sources, end=begin + period)
    pulses = [cycle for cycle, _, level in edges if level and cycle > reset + period]
    return "" if pulses[:1] == [begin] else f"the second chip begins at {pulses[:1]} instead of {begin}"


def goes_wrong(case: Pair, right: Pair, kind: str, wire: Wire, rng: random.Random) -> str:
    """What a mutant does wrong in some run; empty if none shows anything."""
    runs: list[Callable[[], str]] = []
    if kind != "first":
        runs += [lambda: second_goes_wrong(case, wire, case.images[1], rng)] * ENVIRONMENTS
    if kind != "second":
        runs += [lambda: first_goes_wrong(case, case.images[0], rng)] * 3
        runs += [lambda: pair_goes_wrong(case, rng)] * 4
    return next((wrong for run in runs if (wrong := run())), "")


# The prover ------------------------------------------------------------------------------------------------


def is_shown(case: Pair, number: int, shown: Counterexample) -> bool:
    """Whether a plain run with a counterexample's inputs is wrong."""
    schedule, image = case.schedules[number], case.images[number]
    if not number:
        return is_wrong(image, schedule, shown)
    rule = schedule.wire
    assert rule is not None
    end = shown.cycle + 2 * case.period
    begin = 0 if shown.reset is None else shown.reset + 2
    wire = dict(shown.levels).get(rule.pin, ((0, 0),))
    text = shown.stimulus(schedule.clock)
    stimuli = parse_stimuli(text, "it.toml", schedule.clock) if text else Stimuli([])
    chunk = join(Machine(image, schedule.clock, shown.options, stimuli).stream(Cycles(end)))
    channels, found, high = [channel.pin for channel in schedule.channels], [], 0
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):
        if (high >> pin & 1) != (level == HIGH):
            high ^= 1 << pin
            found.append(
                (cycle, channels.index(PINS[pin]) if PINS[pin] in channels else -1, int(level == HIGH))
            )
    return bool(fault(schedule, wire, found, begin, end))


def answer(case: Pair, proof: PairProof) -> str:
    """What the prover says, in a word."""
    if proof.proven:
        return "PROVEN"
    for number, (_, found, _) in enumerate(proof.chips):
        if found.counterexample is not None:
            shown = is_shown(case, number, found.counterexample)
            return "counterexample, repeated" if shown else "counterexample, NOT REPEATED"
    return "do not fit together" if all(found.proven for _, found, _ in proof.chips) else "not decided"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--mutants", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = random.Random(asked.seed)
    answers: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    wires: dict[str, Wire] = {}
    unseen = done = 0
    while done < asked.mutants:
        name = "players" if done % 10 == 9 else "counted"
        kind = rng.choice(("first", "first", "second", "second", "timing"))
        right = pair(name)
        if name not in wires:
            end = (FRAMES + 14) * right.period
            wires[name] = wire_of(right, edges_of(right.images[0], right.schedules[0],
                                                  board_of(right.schedules[0]), end=end))  # fmt: skip
        case = mutant(right, kind, rng)
        wrong = goes_wrong(case, right, kind, wires[name], rng)
        if not wrong:
            unseen += 1
            continue
        texts = case.schedules[0].json_text().encode(), case.schedules[1].json_text().encode()
        proof = prove_pair(case.schedules, case.images, texts, MAX_STATES)
        found = answer(case, proof)
        done += 1
        kinds[f"{name}, {kind}"] += 1
        answers[found] += 1
        if "PROVEN" in found or "NOT" in found:
            print(f"{name}, {kind}: {found}: {wrong}; {proof.summary()}")
    print(f"{done} mutants that go wrong, {unseen} others; {time.process_time():.0f} s")
    print("; ".join(f"{count} {text}" for text, count in sorted(kinds.items())))
    print("; ".join(f"{count} {text}" for text, count in sorted(answers.items())))
    return int(any("PROVEN" in text or "NOT" in text for text in answers))


if __name__ == "__main__":
    sys.exit(main())
