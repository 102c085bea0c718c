"""What a stream program does on a random line is what the theorem about any line allows.

    python -m tests.prove.random_lines --frames 10000 --seed 1

The plain simulator runs a stream job from power-ups with random start values and random bytes in the EEPROM,
on a line with commands, random, torn, broken and noisy bytes, and senders up to 2 % off. Every edge must be
the one of the model of the chip (tests/engines/stream/chip_model.py). At every slot, once its pulse is
prepared, the variables in the RAM must be those of the prover's specification (prove/stream/chip.py), and
satisfy what the lemmas assume between two steps; the receiver must be in one of its states, no pulse late.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from servogen.edges import EdgeChunk
from servogen.engines.board import board_of
from servogen.engines.stream.layout import ROUND
from servogen.engines.stream.protocol import NO_TRIM
from servogen.pic.device import EEPROM_BYTES
from servogen.prove.stream.bits import Bits, byte
from servogen.prove.stream.chip import StreamChip
from servogen.prove.stream.chip_bytes import chip_bytes, invariant, receiver_counts
from servogen.prove.stream.execution import EEPROM
from servogen.prove.stream.names import Names
from servogen.simulator import Machine, SimulatorOptions, Stimuli
from servogen.simulator import layout as at
from servogen.verify import verdict_lines
from tests.engines.stream import chip_model
from tests.engines.stream.stream_line import Line, talk
from tests.engines.stream.stream_soak import Firmware, check, firmware, first_rise, line_of

JOBS = ("stream-arm", "stream-eight", "stream-fast")
RUN_FRAMES = 1000
"""Frames from one power-up to the next."""
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Target:
    """A program, and where its variables are."""

    made: Firmware
    names: Names


def target(name: str, dialect: str = "c2c") -> Target:
    made = firmware(name, dialect)
    return Target(made, Names(made.listing, made.streamed))


@dataclass(frozen=True)
class Run:
    """A chip at power-up and its line."""

    made: Firmware
    options: SimulatorOptions
    line: Line

    @property
    def trims(self) -> list[int]:
        return [self.made.image.eeprom[n] for n in range(len(self.made.streamed.neutral))]


def random_run(aim: Target, seed: int, frames: int) -> Run:
    dice = random.Random(seed)
    made = aim.made
    eeprom = {n: dice.choice((NO_TRIM, 0, 127, 128, dice.randrange(256))) for n in range(EEPROM_BYTES)}
    image = replace(made.image, eeprom=eeprom)
    schedule = made.streamed.plan.schedule
    options = board_of(schedule, SimulatorOptions(start_seed=seed, tmr0_phase=seed % 4))
    made = replace(made, image=image, first_rise=first_rise(made.streamed, image, options))
    line = line_of(made, seed)
    while line.now < frames * schedule.period:
        talk(line, 1)
        line.noise(dice.random() / 50)
    return Run(made, options, line)


def walk(aim: Target, run: Run) -> Iterator[str]:
    """Yield what the theorem does not allow in a run."""
    chip = chip_model.Chip(run.made.streamed, dict(enumerate(run.trims)))
    verdict = check(run.made, run.line, chip, run.options)
    if not verdict.passed:
        yield f"{'; '.join(verdict_lines(verdict))}"
    for cycle, wrong in states(aim, run):
        yield f"cycle {cycle}: {wrong}"
        return


def states(aim: Target, run: Run) -> Iterator[tuple[int, str]]:
    """Yield the slots in which the variables are not those of the specification: (cycle, what differs)."""
    names, streamed = aim.names, run.made.streamed
    slot, slots = streamed.layout.rounds * ROUND, streamed.layout.slots
    chip = StreamChip.after_reset(streamed, [byte(trim) for trim in run.trims])
    chip.begin_frame()
    chip.prepare(0)
    coming = iter(run.line.heard)
    ahead = next(coming, None)
    counts = receiver_counts(streamed)
    for number, row in enumerate(visits(aim, run)):
        following, rise = (number + 1) % slots, run.made.first_rise + number * slot
        if following == 0:
            chip.begin_frame()
        if following < chip.servos:
            chip.prepare(following)
        wanted = chip_bytes(names, chip, byte(following))
        cycle = int(row[at.CYCLE])
        if not rise < cycle < rise + slot:
            yield cycle, f"the pulse of slot {number + 1} is prepared outside of the slot before it"
        for place, bits in wanted.items():
            if place < EEPROM and int(row[place]) & 0xFF != bits.value:
                yield cycle, f"place 0x{place:02X} is {int(row[place]) & 0xFF}, not {bits.value}"
        if not invariant(names, chip, lambda place, row=row: of_row(row, place)).known:
            yield cycle, "what holds between two steps does not"
        if int(row[names.at("rx_bits")]) & 0xFF not in counts or int(row[names.at("due")]) & 1:
            yield cycle, "the receiver is in none of its states, or a pulse was late"
        while ahead is not None and ahead[0] <= rise:
            command = ahead[1]
            chip.execute(command.kind.value + command.servo, byte(command.value))
            ahead = next(coming, None)


def of_row(row: Rows, place: int) -> Bits:
    return byte(int(row[place]))


def visits(aim: Target, run: Run) -> Iterator[Rows]:
    """The chip's state each time that a pulse has been prepared."""
    schedule = run.made.streamed.plan.schedule
    machine = Machine(run.made.image, schedule.clock, run.options, Stimuli([run.line]))
    machine.breakpoints = {aim.names.after_clear}
    parts: Iterator[tuple[EdgeChunk, Rows]] = machine.visits(int(run.line.now))
    for _, rows in parts:
        yield from rows


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dialect", default="c2c")
    parser.add_argument("jobs", nargs="*", default=JOBS)
    asked = parser.parse_args()
    wrong = 0
    for name in asked.jobs:
        aim, began = target(name, asked.dialect), time.process_time()
        runs = -(-asked.frames // RUN_FRAMES)
        sent = heard = 0
        for number in range(runs):
            run = random_run(aim, asked.seed + number, RUN_FRAMES)
            sent, heard = sent + run.line.sent, heard + len(run.line.heard)
            for message in walk(aim, run):
                wrong += 1
                print(f"{name}, seed {asked.seed + number}: {message}", flush=True)
        print(
            f"{name}, {asked.dialect}: {runs * RUN_FRAMES} frames after {runs} power-ups, {sent} messages, "
            f"{heard} commands, {wrong} outside of the theorem, {time.process_time() - began:.0f} s",
            flush=True,
        )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
