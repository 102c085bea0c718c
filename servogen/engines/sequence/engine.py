"""The sequence engine of a job: pulses rounded to the nearest whole cycles, delays tuned on the simulator."""

from __future__ import annotations

from functools import cache

from servogen.engines.protocol import Engine, EngineJob, EnginePlan
from servogen.engines.sequence.tuning import tune
from servogen.pulse.plan import plan


class SequenceEngine:
    """Plays a motion as port writes with delays between them."""

    title = "the sequence engine"

    def plan(self, job: EngineJob) -> EnginePlan:
        """Plan the pulses; a dialect's delays are tuned when its firmware is requested."""
        planned = plan(job.trajectory, job.servos, job.frame)
        make = cache(lambda dialect: tune(planned.schedule, dialect, job.device, job.name))
        return EnginePlan(job.trajectory, planned, make)


ENGINE: Engine = SequenceEngine()
