"""Random presses, noise and start values on a plain chip: each frame is one that the proof allows.

    python -m tests.prove.random_frames --frames 1000000 --seed 1

The plain simulator runs a player with buttons, whose pins change at random moments. At every cut point its
registers and RAM must lie within one of the states of the proof with the same place in the specification;
every edge on the way must be the one specified.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from servogen.edges import PINS
from servogen.engines.board import board_of
from servogen.pic.image import Image
from servogen.prove import Proof, prove_for_all
from servogen.prove.explore import Node
from servogen.prove.forks import Program
from servogen.prove.specification import Edge, Specification, SpecState
from servogen.pulse import PulseSchedule
from servogen.simulator import Change, Machine, Options, Recorded, State, Stimuli
from servogen.simulator.abstract import FIELD
from servogen.simulator.layout import PHASED
from tests.engines.player.player_jobs import built_text, job_text, sweep

BUTTONS = 'start_pin = "RA4"\nstop_pin = "RB7"\n'
NOISE = ("RA0", "RA1", "RA2", "RA3")
RUN_FRAMES = 400
"""Frames from one power-up to the next."""


@dataclass(frozen=True)
class Target:
    """A program with its proof."""

    image: Image
    schedule: PulseSchedule
    proof: Proof
    by_place: dict[tuple[int, SpecState], list[Node]]


@cache
def target(buttons: str = BUTTONS) -> Target:
    done = built_text(job_text(3, sweep(3, 0.24), firmware=f"soft_start_s = 0.16\n{buttons}"))
    image, schedule = done.programs[0].image, done.plan.schedule
    proof = prove_for_all(image, schedule)
    assert proof.proven, proof.reason
    places: dict[tuple[int, SpecState], list[Node]] = defaultdict(list)
    for node in proof.nodes[1:]:
        places[pc_of(proof, node), node.spec].append(node)
    return Target(image, schedule, proof, places)


def rest_of(proof: Proof, node: Node) -> tuple[int, ...]:
    assert proof.transitions is not None
    return proof.transitions.rest(node.rest)


def pc_of(proof: Proof, node: Node) -> int:
    return rest_of(proof, node)[FIELD["PC"]] & 0x3FF


def presses(rng: random.Random, schedule: PulseSchedule, frames: int) -> list[Change]:
    """Return random changes: presses of some frames with bounces, and noise on pins that nobody reads."""
    end = frames * schedule.period
    found = [Change(0, PINS.index(pin), 1) for pin in ("RA4", "RB7")]
    for name in ("RA4", "RB7"):
        at = rng.randrange(8 * schedule.period)
        while at < end:
            length = rng.randrange(1, 7 * schedule.period)
            for level, moment in ((0, at), (1, at + length)):
                for _ in range(rng.randrange(4)):
                    bounce = moment + rng.randrange(schedule.period // 4)
                    found += [Change(bounce, PINS.index(name), rng.randrange(2))]
                found.append(Change(moment + schedule.period // 4, PINS.index(name), level))
            at += length + rng.randrange(1, 12 * schedule.period)
    for name in NOISE:
        found += [Change(rng.randrange(end), PINS.index(name), rng.randrange(2)) for _ in range(frames)]
    return sorted(found)


def walk(aim: Target, seed: int, frames: int) -> Iterator[str]:
    """Run from one power-up, and yield what the proof does not allow."""
    rng = random.Random(seed)
    changes = presses(rng, aim.schedule, frames)
    board = board_of(aim.schedule, Options(start_seed=seed, tmr0_phase=rng.randrange(4)))
    machine = Machine(aim.image, aim.schedule.clock, board, Stimuli([Recorded(changes)]))
    spec = Specification(aim.schedule, aim.schedule.buttons)
    reads = Program(aim.image).port_reads()
    machine.breakpoints = set(aim.proof.cuts) | reads
    state, high, end = spec.start(), 0, frames * aim.schedule.period
    while machine.cycles < end:
        before = machine.cycles
        edges, high = driven(machine.run(end), before, high)
        state = spec.advance(state, edges, machine.cycles - before)
        if machine.pc in aim.proof.cuts:
            chip = machine.state()
            if not any(covers(aim.proof, node, chip) for node in aim.by_place.get((machine.pc, state), ())):
                yield f"seed {seed}: cycle {machine.cycles}: no state of the proof covers this one"
        if machine.pc in reads:
            bit = aim.image.program[machine.pc] >> 7 & 7
            port = "A" if aim.image.program[machine.pc] & 0x7F == 5 else "B"
            pin = PINS.index(f"R{port}{bit}")
            level = machine.state().registers[f"PORT{port}"] >> bit & 1
            state = spec.sample(state, pin, level)


def driven(chunk: Sequence[Sequence[int]], begun: int, high: int) -> tuple[list[Edge], int]:
    found = []
    for cycle, pin, level in zip(*(column.tolist() for column in chunk), strict=True):  # type: ignore[attr-defined]
        if high >> pin & 1 != int(level == 1):
            high ^= 1 << pin
            found.append((cycle - begun, pin, int(level == 1)))
    return found, high


def covers(proof: Proof, node: Node, chip: State) -> bool:
    """Return whether a plain chip lies within a state of the proof."""
    rest = rest_of(proof, node)
    timer = chip.registers["TMR0"]
    phased = rest[FIELD["T0_UNKNOWN"]] == PHASED
    if not phased and (timer ^ rest[FIELD["T0_VALUE"]]) & ~rest[FIELD["T0_UNKNOWN"]] & 0xFF:
        return False
    for cell, byte in zip(node.ram, chip.ram, strict=True):
        if cell >> 16:
            if (byte - timer) & 0xFF != cell & 0xFF:
                return False
        elif (byte ^ cell) & ~(cell >> 8) & 0xFF:
            return False
    for field, name in (("OPTION", "OPTION_REG"), ("PCLATH", "PCLATH")):
        if rest[FIELD[field]] != chip.registers[name]:
            return False
    return rest[FIELD["TRIS"]] == chip.registers["TRISA"] | chip.registers["TRISB"] << 5


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    aim = target()
    wrong = 0
    for number in range(max(1, asked.frames // RUN_FRAMES)):
        for message in walk(aim, asked.seed + number, RUN_FRAMES):
            wrong += 1
            print(message)
    print(f"{asked.frames} frames, {wrong} outside of the proof's {aim.proof.states} states")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
