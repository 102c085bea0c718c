"""An attack on `servogen prove`: firmware whose fault shows only under a certain stimulus must not be proven.

    python -m tests.prove.attack --mutants 100 --seed 1

One word of a small player job is changed: a bit, a table's byte, or the whole word. The simulator runs the
mutant as `verify` does, and then under random presses of the buttons, noise on the other inputs, and random
RAM and registers at power-up. A mutant that only these show to be wrong is given to the prover. What is
expected comes from the checker's own state machine of the buttons, not from the prover's.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

from servogen.checker import Refused, check_certificate, read_certificate
from servogen.checker.plan import OVER, Plan, read_plan
from servogen.engines.board import board_of
from servogen.pic.image import Image
from servogen.pic.isa import decode, encode
from servogen.prove import certificate, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.simulator import Levels, Machine, Options, Stimuli
from servogen.simulator.sources import Source
from tests.engines.player.player_jobs import built_text, job_text, sweep

JOBS = {
    "stop, hold": 'stop_pin = "RB7"\nstop_pulses = "hold"\n',
    "stop, off": 'stop_pin = "RB7"\n',
    "start": 'start_pin = "RA4"\n',
    "start and stop": 'start_pin = "RA4"\nstop_pin = "RB7"\n',
    "no button": "",
}
FRAMES = 45
SETTLED = 1000
"""Cycles of a frame after which the pins change: long before they are read, after its last slot."""
ENVIRONMENTS = 16
NEAR = 24
"""Words before and after an instruction that reads a port."""
READS = {decode(encode(name, f=f, b=b)) for name in ("BTFSC", "BTFSS") for f in (5, 6) for b in range(8)}


@dataclass(frozen=True)
class Target:
    """A job's program, with what it should do."""

    name: str
    image: Image
    schedule: PulseSchedule
    text: bytes
    plan: Plan
    first: int
    """The cycle of the first rise."""


@dataclass(frozen=True)
class Environment:
    """The levels of the buttons in each frame, noise on other inputs, and the values at power-up."""

    buttons: tuple[int, ...]
    noise: tuple[tuple[int, int, int], ...] = ()
    """(cycle, pin, level), in order."""
    start_seed: int | None = None


def target(name: str) -> Target:
    done = built_text(job_text(3, sweep(3, 0.32), firmware="soft_start_s = 0.16\n" + JOBS[name]))
    program = done.programs[0]
    assert program.verdict.start is not None
    text = done.plan.schedule.json_text().encode()
    plan = read_plan(text, "schedule.json")
    return Target(name, program.image, done.plan.schedule, text, plan, int(program.verdict.start))


def as_verified(case: Target) -> Environment:
    """What `verify` runs: start pressed, stop released, nothing on the other pins."""
    level = 0
    for button, pressed in ((case.plan.start, True), (case.plan.stop, False)):
        if button:
            level |= (button.pressed if pressed else 1 - button.pressed) << button.pin
    return Environment((level,) * FRAMES)


def random_environment(case: Target, rng: random.Random) -> Environment:
    """Presses of 1 to 9 frames, and perhaps noise and other values at power-up."""
    levels = [0] * FRAMES
    for button in (case.plan.start, case.plan.stop):
        frame = 0
        level = rng.randrange(2)
        while button and frame < FRAMES:
            span = rng.choice((1, 2, 3, 3, 4, 9, 30))
            for each in range(frame, min(frame + span, FRAMES)):
                levels[each] |= level << button.pin
            frame += span
            level ^= 1
    free = [pin for pin in range(13) if not (case.plan.channels | case.plan.buttons) >> pin & 1]
    end = case.first + FRAMES * case.plan.period
    noise = [(rng.randrange(end), rng.choice(free), rng.randrange(2)) for _ in range(rng.choice((0, 60)))]
    seed = rng.choice((None, rng.randrange(1 << 20)))
    return Environment(tuple(levels), tuple(sorted(noise)), seed)


def expected(case: Target, around: Environment) -> list[tuple[int, int]]:
    """(cycle since the first rise, levels of all pins), as the state machine of the buttons says."""
    position, found = case.plan.first(), []
    for frame in range(FRAMES):
        at, out = case.plan.due(position)
        found += [(frame * case.plan.period + int(a), int(o)) for a, o in zip(at, out, strict=True)]
        if position != OVER:
            position = case.plan.after(position, around.buttons[frame])
    return [(cycle - found[0][0], out) for cycle, out in found]


def sources(case: Target, around: Environment) -> list[Source]:
    made: list[Source] = []
    for pin in range(13):
        if case.plan.buttons >> pin & 1:
            levels = [around.buttons[0] >> pin & 1, *(each >> pin & 1 for each in around.buttons[1:])]
            times = [0, *(case.first + frame * case.plan.period + SETTLED for frame in range(1, FRAMES))]
            made.append(Levels(pin, list(zip(times, levels, strict=True))))
        else:
            changes = [(cycle, level) for cycle, each, level in around.noise if each == pin]
            made += [Levels(pin, changes)] if changes else []
    return made


def observed(case: Target, image: Image, around: Environment, frames: int) -> list[tuple[int, int]]:
    """What the simulator does, in the same form."""
    options: Options = replace(board_of(case.schedule), start_seed=around.start_seed)
    machine = Machine(image, case.schedule.clock, options, Stimuli(sources(case, around)))
    out, found = 0, []
    chunk = machine.run(case.first + frames * case.plan.period)
    cycles = chunk.cycle.tolist()
    following_cycles = [*cycles, -1][1:] if cycles else []
    edges = zip(cycles, chunk.pin.tolist(), chunk.level.tolist(), following_cycles, strict=True)
    for cycle, pin, level, following in edges:
        out = out & ~(1 << pin) | (level == 1) << pin
        if following != cycle and out != (found[-1][1] if found else 0):
            found.append((cycle, out))
    return [(cycle - found[0][0], out) for cycle, out in found]


def is_right(case: Target, image: Image, around: Environment, frames: int = FRAMES) -> bool:
    end = (frames - 1) * case.plan.period
    wanted = [edge for edge in expected(case, around) if edge[0] < end]
    return [edge for edge in observed(case, image, around, frames) if edge[0] < end] == wanted


def mutants(case: Target, rng: random.Random) -> Iterator[tuple[str, Image]]:
    """Endless: one word changed, of every second one a word near an instruction that reads a port."""
    everywhere = list(case.image.program)
    reads = [each for each in everywhere if decode(case.image.program[each]) in READS]
    near = [each for each in everywhere if any(abs(each - read) <= NEAR for read in reads)]
    while True:
        address = rng.choice(near if near and rng.random() < 0.5 else everywhere)
        word = case.image.program[address]
        row = decode(word)
        kind = rng.random()
        if row is not None and row.instruction.mnemonic == "RETLW" and kind < 0.5:
            new = word & ~0xFF | rng.randrange(256)
        elif kind < 0.85:
            new = word ^ 1 << rng.randrange(14)
        else:
            new = rng.randrange(1 << 14)
        if decode(new) != row:
            what = f"0x{address:03X}: {word:04X} -> {new:04X}"
            yield what, replace(case.image, program={**case.image.program, address: new})


def hidden(case: Target, image: Image, rng: random.Random) -> Environment | None:
    """The stimulus that shows a fault which `verify` would not see; None if there is no such fault."""
    if not is_right(case, image, as_verified(case), 3) or not is_right(case, image, as_verified(case)):
        return None
    for _ in range(ENVIRONMENTS):
        around = random_environment(case, rng)
        if not is_right(case, image, around):
            return around
    return None


def attack(names: list[str], count: int, seed: int, max_states: int) -> tuple[Counter[str], list[str]]:
    """Counts of mutants tried, hidden faults and the prover's answers to them; the wrong answers."""
    rng = random.Random(seed)
    cases = [target(name) for name in names]
    for case in cases:
        for around in (as_verified(case), *(random_environment(case, rng) for _ in range(10))):
            assert is_right(case, case.image, around), (case.name, around)
    streams = [mutants(case, rng) for case in cases]
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    while counts["hidden faults"] < count:
        turn = counts["mutants"] % len(cases)
        case, (what, image) = cases[turn], next(streams[turn])
        counts["mutants"] += 1
        if hidden(case, image, rng) is None:
            continue
        counts["hidden faults"] += 1
        proof = prove_for_all(image, case.schedule, options=board_of(case.schedule), max_states=max_states)
        answer = "proven" if proof.proven else "counterexample" if proof.counterexample else "not decided"
        counts[answer] += 1
        print(f"{counts['hidden faults']} of {counts['mutants']}: {case.name}, {what}: {answer}", flush=True)
        if proof.proven:
            wrong.append(f"{case.name}, {what}: {second_opinion(case, image, proof)}")
    return counts, wrong


def survivors(names: list[str], count: int, seed: int, max_states: int) -> tuple[Counter[str], list[str]]:
    """Counts of the answers to `count` mutants that no stimulus has shown to be wrong; the wrong proofs.

    If one is proven, the checker must accept the certificate, and more stimuli must find nothing.
    """
    rng = random.Random(seed)
    cases = [target(name) for name in names]
    streams = [mutants(case, rng) for case in cases]
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    while counts["survivors"] < count:
        turn = counts["mutants"] % len(cases)
        case, (what, image) = cases[turn], next(streams[turn])
        counts["mutants"] += 1
        if not is_right(case, image, as_verified(case), 3) or not is_right(case, image, as_verified(case)):
            continue
        if any(not is_right(case, image, random_environment(case, rng)) for _ in range(4)):
            continue
        counts["survivors"] += 1
        proof = prove_for_all(image, case.schedule, options=board_of(case.schedule), max_states=max_states)
        counts["proven" if proof.proven else "not proven"] += 1
        if not proof.proven:
            continue
        opinion = second_opinion(case, image, proof)
        right = all(is_right(case, image, random_environment(case, rng)) for _ in range(40))
        print(f"{counts['survivors']}: {case.name}, {what}: {opinion}, right: {right}", flush=True)
        if opinion != AGREED or not right:
            wrong.append(f"{case.name}, {what}: {opinion}, right: {right}")
    return counts, wrong


AGREED = "proven, and the checker agrees"


def second_opinion(case: Target, image: Image, proof: object) -> str:
    """What the checker says of the certificate of a proof."""
    try:
        claim = read_certificate(certificate(proof, image, case.schedule, case.text), "certificate")
        check_certificate(claim, image, case.text, "schedule.json")
    except Refused as refused:
        return f"proven; the checker refuses: {refused}"
    return AGREED


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", nargs="*", choices=list(JOBS), default=list(JOBS))
    parser.add_argument("--max-states", type=int, default=20_000)
    parser.add_argument(
        "--survivors", action="store_true", help="mutants without a fault, if they are proven"
    )
    wanted = parser.parse_args()
    began = time.monotonic()
    work = survivors if wanted.survivors else attack
    counts, wrong = work(wanted.jobs, wanted.mutants, wanted.seed, wanted.max_states)
    print(dict(counts), f"{time.monotonic() - began:.0f} s", *wrong, sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
