"""Random levels on the line of a walk on command, against a state machine and angles of their own.

    python -m tests.engines.player.command_walks --frames 1000000 --seed 1

The committed program runs on the plain simulator while its line has codes, torn codes, noise and silence.
What each frame must be follows from the rules of docs/firmware.md, typed here, and the planned angles of the
directions, not from the player's encoding: every width within the stated plan error of the angle's, every
edge in the cycle that schedule.json has for that frame.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from servogen.edges import HIGH, PINS, join
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.image import Image, read_hex
from servogen.pulse.schedule import PulseSchedule, Run, from_json
from servogen.simulator import Levels, Machine, SimulatorOptions, Stimuli

ROOT = Path(__file__).parents[3]
JOB = "hexapod-command"
CODES = {"001010": "forward", "000110": "back", "011000": "left", "011011": "right"}
REVERSED = {"back": "forward", "right": "left"}
CHANGES_AT = 1000
"""The cycle of a frame in which the line changes: the program reads it after the last slot."""

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Target:
    """A job with its schedule, and the ideal widths of its lead-in, its stance and its directions, µs."""

    job: PlannedJob
    schedule: PulseSchedule
    stance: Floats
    directions: dict[str, Floats]
    """Rows from the stance up to the last before it."""
    cycle: dict[str, tuple[int, int]]


@cache
def target() -> Target:
    """Return the committed job with its committed schedule."""
    job = plan_job(load(ROOT / "jobs" / f"{JOB}.toml"))
    return target_of(job, from_json((ROOT / "firmware" / JOB / "schedule.json").read_text(), "schedule.json"))


def target_of(job: PlannedJob, schedule: PulseSchedule) -> Target:
    """Return a job that walks on command, with the widths of its planned angles."""

    def widths(angles: Floats) -> Floats:
        return np.array(
            [[s.width_us(a) for s, a in zip(job.servos, row, strict=True)] for row in angles.tolist()]
        )

    planned = {direction.name: direction for direction in job.directions}
    directions, cycle = {}, {}
    for name in planned:
        forward = planned[REVERSED.get(name, name)]
        rows, last = forward.angles, len(forward.angles) - 1
        if name in REVERSED:  # backward: the same rows, the last first
            directions[name], cycle[name] = widths(rows[:0:-1]), (last - forward.end, last - forward.first)
        else:
            directions[name], cycle[name] = widths(rows[:-1]), (forward.first, forward.end)
    return Target(job, schedule, widths(job.trajectory.angles[:1])[0], directions, cycle)


@cache
def image(dialect: str = "") -> Image:
    file = ROOT / "firmware" / JOB / f"main{dialect}.hex"
    return read_hex(file.read_text(), file.name).image


@dataclass
class Walker:
    """What the robot must do in each frame: a direction and a row of it; before, the lead-in's frame."""

    of: Target
    history: str = "0"
    wanted: str = ""
    direction: str = ""
    row: int = -1

    def hear(self, level: int) -> None:
        self.history = (self.history + str(level))[-9:]
        if self.history[-9:-6] == "111" and self.history[-6:] in CODES:
            self.wanted = CODES[self.history[-6:]]
        elif self.history[-5:] == "00000":
            self.wanted = ""

    def next(self) -> tuple[str, int]:
        """Return the next frame; its direction is empty in the lead-in and, at row `lead_in`, the stance."""
        lead_in = self.of.schedule.lead_in_frames
        self.row += 1
        if self.direction:
            first, end = self.of.cycle[self.direction]
            if self.row in (first, end):
                self.row = first if self.wanted == self.direction else end
            if self.row == len(self.of.directions[self.direction]):
                self.direction, self.row = "", lead_in
        if not self.direction and self.row >= lead_in:
            self.direction, self.row = (self.wanted, 0) if self.wanted else ("", lead_in)
        return self.direction, self.row


def random_line(rng: np.random.Generator, frames: int) -> list[int]:
    """Return the line's level in each frame: codes with rest between them, torn ones, noise, silence."""
    found = ""
    codes = list(CODES)
    while len(found) < frames:
        code = codes[rng.integers(len(codes))]
        kind = rng.integers(8)
        if kind < 4:
            found += code + "1" * int(rng.integers(1, 150))
        elif kind == 4:
            at = int(rng.integers(len(code)))
            found += (
                code[:at]
                + str(rng.integers(2))
                + code[at + int(rng.integers(2)) :]
                + "1" * int(rng.integers(6))
            )
        elif kind == 5:
            found += "".join(map(str, rng.integers(0, 2, int(rng.integers(1, 40))).tolist()))
        elif kind == 6:
            found += "0" * int(rng.integers(1, 12)) + "1" * int(rng.integers(1, 60))
        else:
            found += "1" * int(rng.integers(200, 400))
    return [int(level) for level in found[:frames]]


def flat(runs: tuple[Run, ...]) -> list[Run]:
    return [run for run in runs for _ in range(run.frames)]


def problems(
    program: Image,
    line: list[int],
    options: SimulatorOptions = SimulatorOptions(),  # noqa: B008
    of: Target | None = None,
) -> Iterator[str]:
    """Yield what differs from the reference, frame by frame; `of` is the committed job if it is omitted."""
    of = of or target()
    schedule, period = of.schedule, int(of.schedule.period)
    start = first_rise(program, options, of)
    changes = [(0, 1)] + [(start + n * period + CHANGES_AT, level) for n, level in enumerate(line)]
    stimuli = Stimuli([Levels(PINS.index(schedule.commands.read.line.pin), tuple(changes))])
    machine = Machine(program, schedule.clock, options, stimuli)
    edges = join(machine.stream(start + len(line) * period))
    parts = {
        direction.name: flat((*direction.start, *direction.cycle, *direction.stop))
        for direction in schedule.commands.directions
    }
    standing = flat((*schedule.lead_in, *schedule.loop))
    measured = {}
    for channel in schedule.channels:
        own = edges.pin == PINS.index(channel.pin)
        cycles, high = edges.cycle[own], edges.level[own] == HIGH
        cycles = cycles[int(np.argmax(high)) :]
        cycles = cycles[: len(cycles) // 2 * 2].reshape(-1, 2)
        measured[channel.name] = {
            int((rise - start) // period): (int(rise - start) % period, int(fall - rise))
            for rise, fall in cycles.tolist()
        }
    walker = Walker(of)
    limit = schedule.plan_error.width_us + 0.001
    for frame, level in enumerate(line):
        direction, row = walker.next()
        exact = (parts[direction] if direction else standing)[row]
        ideal = of.directions[direction][row] if direction else of.stance
        where = f"frame {frame}, {direction or 'standing'} {row}"
        for number, channel in enumerate(schedule.channels):
            pulse, seen = exact.pulses[number], measured[channel.name].get(frame)
            if seen != (int(pulse.rise), int(pulse.width)):
                yield f"{where}: {channel.name} {seen}, not {pulse}"
            elif row < schedule.lead_in_frames and not direction:
                continue
            elif abs(float(schedule.clock.us(seen[1])) - ideal[number]) > limit:
                yield f"{where}: {channel.name} {seen[1]} cycles, planned {ideal[number]} µs"
        walker.hear(level)


def first_rise(program: Image, options: SimulatorOptions, of: Target) -> int:
    machine = Machine(program, of.schedule.clock, options)
    found = machine.run_to_edge(PINS.index("RB0"), HIGH, 50 * of.schedule.period)
    assert found is not None
    return int(found)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    done = 0
    number = 0
    while done < given.frames:
        rng = np.random.default_rng((given.seed, number))
        dialect = ("", ".xc8", ".sdcc")[number % 3]
        line = random_line(rng, min(10_000, given.frames - done))
        found = next(problems(image(dialect), line, SimulatorOptions(start_seed=number)), None)
        if found:
            print(f"run {number}, main{dialect}.hex: {found}")
            return 1
        done += len(line)
        number += 1
    print(f"{done} frames, {number} power-ups: every edge is the reference's")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
