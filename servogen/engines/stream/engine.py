"""The stream engine of a job: planned and compiled.

In: a job with a serial line, and a dialect. Out: its plan and the firmware.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from servogen.compiler import Options
from servogen.engines.firmware import Firmware, TimingBudget, compiled_to_fit
from servogen.engines.inputs import given
from servogen.engines.inputs.serial import Stream
from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.engines.stream.protocol import BITS, BYTES
from servogen.engines.stream.rendering import OVERRUN, render_stream
from servogen.engines.stream.response import response
from servogen.engines.stream.settings import UNIT
from servogen.engines.stream.streaming import Streaming, streaming
from servogen.errors import InputError
from servogen.motion import JointTrajectory
from servogen.pic.listing import Listing
from servogen.pulse.schedule import Input, PulseSchedule
from servogen.units import Cycles

TRIMS = 256
"""The maximum distance between two trims, by which a servo's way to its goal can exceed its travel."""
TITLE = "the stream engine"
HINT = "fewer servos, or none on the other port"
"""The hint if the chip is too small."""


def stream(job: EngineJob) -> tuple[JointTrajectory, Streaming]:
    """Return the motion of the firmware without commands, which is the neutral pose, and its parts.

    Raises InputError.
    """
    line = given(job.inputs, Stream)
    if line is None:
        raise InputError("missing-key", f"{job.name} has no serial line", hint="add a table [stream]")
    streamed = streaming(
        job.servos,
        job.frame,
        job.clock,
        line,
        job.firmware.soft_start_s,
        job.firmware.soft_start_place,
    )
    idle = replace(streamed.plan.schedule, inputs=(Input(line.receive_pin, 1),))
    plan = replace(streamed.plan, schedule=idle)
    return _idle(job, idle), replace(streamed, plan=plan)


def _idle(job: EngineJob, schedule: PulseSchedule) -> JointTrajectory:
    """Return the neutral pose frame by frame; NaN where the fail-safe switches the pulses off."""
    runs = (*schedule.lead_in, *schedule.loop)
    rows = [
        [servo.neutral if pulse else math.nan for servo, pulse in zip(job.servos, run.pulses, strict=True)]
        for run in runs
    ]
    angles = np.repeat(np.array(rows), [run.frames for run in runs], axis=0)
    names = tuple(servo.name for servo in job.servos)
    return JointTrajectory(names, job.clock, schedule.period, angles, schedule.lead_in_frames)


def compiled(job: EngineJob, streamed: Streaming, dialect: str) -> Firmware:
    """Return the firmware in `dialect`. Raises ResourceError if the chip is too small."""
    built = firmware(render_stream(streamed, dialect, job.device, job.name), job, dialect)
    budgets = timing_budgets(built.compilation.listing, streamed)
    return replace(built, timing_budgets=budgets)


def timing_budgets(listing: Listing, streamed: Streaming) -> tuple[TimingBudget, ...]:
    """Return the time that the C takes to prepare a pulse, and the time that interrupts leave it, on any
    line.
    """
    byte = (streamed.first_units + (BITS - 1) * streamed.bit_units) * UNIT
    travel = max(travel.maximum - travel.minimum for travel in streamed.travels) + TRIMS
    bound = response(listing, streamed.layout.rounds, travel, BYTES * byte)
    supply = bound.supply or Cycles(0)
    return (
        TimingBudget("a request and its slot", bound.prepare, supply),
        TimingBudget("the same, after a command", bound.after_command, supply),
    )


def firmware(text: str, job: EngineJob, dialect: str) -> Firmware:
    """Return the compiled C of a stream. Raises ResourceError if the chip is too small."""
    file = f"main.{dialect}.c"
    options = Options(dialect=dialect, device=job.device)
    compilation = compiled_to_fit(text, file, options, job.name, TITLE, HINT)
    return Firmware(dialect, file, text, compilation, overrun=compilation.listing.variable(OVERRUN))


class StreamEngine:
    """Receives positions over a serial line."""

    title = TITLE

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plan the job's frames; a dialect's C is compiled when its firmware is requested."""
        idle, streamed = stream(job)
        make = cache(lambda dialect: compiled(job, streamed, dialect))
        return EnginePlan(idle, streamed.plan, make)


ENGINE: Engine = StreamEngine()
