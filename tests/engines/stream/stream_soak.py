"""A stream job's program on a serial line: its edges are held to the model of the chip."""

from __future__ import annotations

import random
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from servogen.edges import HIGH, PINS, EdgeTrace, part
from servogen.engines.board import board_of
from servogen.engines.stream.engine import stream
from servogen.engines.stream.firmware import compiled
from servogen.engines.stream.streaming import Streaming
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.image import Image
from servogen.pic.listing import Listing
from servogen.pulse.expected import expected
from servogen.simulator import Machine, SimulatorOptions, Stimuli
from servogen.units import Cycles
from servogen.verify import Verdict, verify
from tests.engines.stream.chip_model import Chip, schedule, widths
from tests.engines.stream.stream_line import Line

JOBS = Path(__file__).parents[3] / "jobs"
OPTIONS = SimulatorOptions()
TWELVE = (
    '[chip]\ndevice = "PIC16F84"\nclock_hz = 4_000_000\n'
    + "".join(
        f'[[servo]]\nname = "{pin}"\npin = "{pin}"\nmodel = "futaba-s3001"\n'
        for pin in (*(f"RB{n}" for n in range(8)), *(f"RA{n}" for n in range(4)))
    )
    + '[stream]\nfail_safe = "off"\n[frame]\nperiod_us = 28_000\n'
)
"""A job whose chip is coarse: one pin is left, for the line."""


@dataclass(frozen=True, slots=True)
class Firmware:
    """A stream job, its numbers, its program in one dialect, and when its first pulse begins."""

    job: PlannedJob
    streamed: Streaming
    image: Image
    words: int
    first_rise: int
    listing: Listing


def firmware(name: str, dialect: str = "c2c") -> Firmware:
    job = plan_job(load(JOBS / f"{name}.toml"))
    return firmware_of(job, dialect)


def firmware_of(job: PlannedJob, dialect: str = "c2c") -> Firmware:
    _, streamed = stream(job)
    made = compiled(job, streamed, dialect).compilation
    rise = first_rise(streamed, made.image)
    return Firmware(job, streamed, made.image, made.words, rise, made.listing)


def first_rise(streamed: Streaming, image: Image, options: SimulatorOptions = OPTIONS) -> int:
    """The cycle after reset in which the first servo's pulse begins."""
    plan = streamed.plan.schedule
    machine = Machine(image, plan.clock, board_of(plan, options))
    found = machine.run_to_edge(PINS.index(plan.channels[0].pin), HIGH, 3 * plan.period)
    assert found is not None
    return found


def line_of(made: Firmware, seed: int) -> Line:
    assert made.job.stream
    pin = PINS.index(made.job.stream.receive_pin)
    return Line(made.streamed, pin, made.first_rise, random.Random(seed))


def check(
    made: Firmware, line: Line, chip: Chip | None = None, options: SimulatorOptions = OPTIONS
) -> Verdict:
    """The edges while the line is played, held to those that the model says."""
    plan = made.streamed.plan.schedule
    frames = int((line.now - made.first_rise) // plan.period) + 4
    commands = [(at - made.first_rise, command) for at, command in line.heard]
    wanted = schedule(made.streamed, islice(widths(made.streamed, commands, chip), frames))
    span = Cycles((frames - 1) * plan.period)
    machine = Machine(made.image, plan.clock, board_of(plan, options), Stimuli([line]))
    end = Cycles(made.first_rise + span)
    out = made.streamed.stream.transmit_pin
    chunks = (part(chunk, chunk.pin != PINS.index(out)) if out else chunk for chunk in machine.stream(end))
    return verify(expected(wanted), EdgeTrace(plan.clock, chunks, end), span)
