"""The stream engine of a job with a serial line: its plan; `firmware` has the C."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from servogen.engines.firmware import Firmware
from servogen.engines.inputs import given
from servogen.engines.inputs.serial import Stream
from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.engines.stream.streaming import Streaming, streaming
from servogen.errors import InputError
from servogen.motion import JointTrajectory
from servogen.pulse.schedule import Input, PulseSchedule


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


class StreamEngine:
    """Receives positions over a serial line."""

    title = "the stream engine"

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plan the job's frames; a dialect's C is compiled when its firmware is requested."""
        idle, streamed = stream(job)

        @cache
        def make(dialect: str) -> Firmware:
            from servogen.engines.stream.firmware import compiled  # the compiler: only to make the firmware

            return compiled(job, streamed, dialect)

        return EnginePlan(idle, streamed.plan, make)


ENGINE: Engine = StreamEngine()
